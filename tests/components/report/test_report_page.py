"""The page about a flight in a real browser, on a desk and on a phone."""

from collections import Counter

import numpy as np
import pytest
from browser_page import PATIENCE_MS, needs_chromium
from recorded_flight import fly, write_recording

from dfvs_service.page.charts import TimeLine
from dfvs_service.page.page import Page, render
from dfvs_service.report.cli import main

pytestmark = needs_chromium


def recording(folder, frames=6):
    """A short flight as a recording; the file."""
    return write_recording(folder, fly(np.random.default_rng(5), frames=frames).events)


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    folder = tmp_path_factory.mktemp("report")
    assert main([str(recording(folder, 30)), "--out", str(folder / "flight.html")]) == 0
    return folder / "flight.html"


@pytest.fixture(params=[(1400, 900), (390, 844)], ids=["desk", "phone"])
def page(request, chromium, report):
    width, height = request.param
    context = chromium.new_context(viewport={"width": width, "height": height})
    page = context.new_page()
    page.set_default_timeout(PATIENCE_MS)
    complaints = []
    page.on("console", lambda message: complaints.append(message.text))
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.goto(report.as_uri())
    yield page
    assert complaints == []
    context.close()


def test_nothing_is_wider_than_the_screen(page):
    assert page.evaluate("document.documentElement.scrollWidth") <= page.viewport_size["width"]


@pytest.mark.parametrize("count", [4, 5, 6])
@pytest.mark.parametrize("width", [390, 820, 1200, 1400])
def test_every_row_of_figures_is_as_wide_as_the_others(chromium, tmp_path, count, width):
    figures = (("angle to the goal, estimated", "12.345 → 10.012 m"),) * count
    target = tmp_path / "page.html"
    line = TimeLine(0.0, 1.0, ())
    target.write_text(render(Page("flight", "it flew", "", (), figures, (), line)))
    page = chromium.new_page(viewport={"width": width, "height": 900})
    page.goto(target.as_uri())
    cards = page.locator(".figures .card")
    rows = Counter(cards.evaluate_all("all => all.map((card) => card.offsetTop)"))
    assert len(rows) <= (count + 1) // 2
    assert count % 2 or len(set(rows.values())) == 1
    right = "all => all.map((c) => [c.offsetTop, c.getBoundingClientRect().right])"
    ends = dict(cards.evaluate_all(right)).values()  # of the last one in each row
    assert max(ends) - min(ends) < 1
    assert all(cards.evaluate_all("all => all.map((c) => c.scrollWidth <= c.clientWidth)"))
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    page.close()


def test_the_film_plays(page):
    page.wait_for_function("() => document.querySelector('video').readyState >= 2")
    assert page.evaluate("document.querySelector('video').duration") > 0.5
    page.evaluate("document.querySelector('video').play()")
    page.wait_for_function("() => document.querySelector('video').currentTime > 0.2")


def test_a_pointer_on_a_plot_reads_all_plots_and_seeks_the_film(page):
    page.wait_for_function("() => document.querySelector('video').readyState >= 2")
    plot = page.locator("svg[data-from]").first
    plot.scroll_into_view_if_needed()
    box = plot.bounding_box()
    page.mouse.move(box["x"] + 0.6 * box["width"], box["y"] + 0.4 * box["height"])
    cursors = page.locator(".cursor").evaluate_all("all => all.map((c) => c.getAttribute('x1'))")
    assert len(set(cursors)) == 1
    assert float(cursors[0]) == pytest.approx(0.6 * 520, abs=3)
    readings = page.locator("output").all_text_contents()
    assert sum(bool(text) for text in readings) > 8
    page.wait_for_function("() => document.querySelector('video').currentTime > 0.1")


def test_a_film_that_is_too_large_for_the_page_plays_beside_it(chromium, tmp_path, monkeypatch):
    monkeypatch.setattr("dfvs_service.report.flight_page.MAX_EMBEDDED_BYTES", 0)
    target = tmp_path / "flight.html"
    assert main([str(recording(tmp_path)), "--out", str(target)]) == 0
    assert "data:video" not in target.read_text()
    page = chromium.new_page()
    page.set_default_timeout(PATIENCE_MS)
    page.goto(target.as_uri())
    page.wait_for_function("() => document.querySelector('video').readyState >= 2")
    page.close()


def test_a_recording_whose_model_is_not_here_has_a_film_without_flow(tmp_path, monkeypatch):
    file = recording(tmp_path)
    monkeypatch.setattr("dfvs_service.replay.flight.flow_matcher", missing)
    assert main([str(file), "--out", str(tmp_path / "x.html"), "--json"]) == 0
    text = (tmp_path / "x.html").read_text()
    assert "No flow is drawn: there is no such model" in text
    assert "<video" in text


def missing(*_):
    from dfvs_core.errors import ConfigError

    raise ConfigError("there is no such model")


def test_the_report_of_a_recording_says_what_the_flight_was_told(report):
    text = report.read_text()
    assert "The recording ends in SERVO: tested" in text
    assert "recording, " in text
    assert "Nothing was recorded." not in text
