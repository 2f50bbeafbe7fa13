"""Thirty-odd situations of the dashboard in a real browser: nothing that is old looks fresh.

``DFVS_SCREENSHOTS=FOLDER`` keeps a picture of each.
"""

import os
import re
from pathlib import Path

import pytest
from browser_page import Page, needs_chromium
from flight_on_screen import TOKEN, Flight, Screen
from situations import ABORT, DESKTOP, DONE, HOLD, PHONE, SERVO, SITUATIONS, long_over, silent

pytestmark = needs_chromium

LIMITS_S = {
    "state": 1.5,
    "vehicle": 1.5,
    "battery": 5.0,
    "results": 1.0,
    "view": 1.0,
    "flow": 1.0,
    "timing": 3.0,
}
FROZEN = """performance.now = () => Number(sessionStorage.getItem('frozen') ?? 1e6);
  const every = setInterval;
  globalThis.setInterval = (work, ms) => every(work, ms / 4);"""
"""The page's clock stands still; what it does at times it does four times as often."""
LOOK = """() => {
  const probe = document.body.appendChild(document.createElement("i"));
  probe.style.color = "var(--good)";
  const good = getComputedStyle(probe).color;
  probe.remove();
  const chain = function* (e) { for (; e; e = e.parentElement) yield e; };
  const isGrey = (e) => [...chain(e)].some((a) => getComputedStyle(a).filter.includes("grayscale"));
  const seen = (query) => [...document.querySelectorAll(query)].filter((e) => e.checkVisibility());
  const bySource = (query, key, of) =>
    Object.entries(Object.groupBy(seen(query), (e) => e.dataset[key]))
      .map(([k, l]) => [k, l.map(of)]);
  const colours = (style) => [style.color, style.backgroundColor, style.borderLeftColor];
  const isGreen = (e) => colours(getComputedStyle(e)).includes(good);
  const text = (id) => document.getElementById(id).textContent;
  return {
    grey: Object.fromEntries(bySource("[data-source]", "source", isGrey)),
    ages: Object.fromEntries(bySource("[data-age-of]", "ageOf", (e) => e.textContent)),
    green: seen("body *").filter((e) => isGreen(e) && !isGrey(e) && !e.closest("#operator"))
      .map((e) => e.id || e.className),
    links: [...document.querySelectorAll("#links tr")].map((e) => e.children[3].textContent),
    title: document.title,
    state: text("state"), server: text("server"), verdict: text("verdict"),
    picked: document.querySelector("#vehicle").selectedOptions[0].textContent,
    tooWide: document.documentElement.scrollWidth - innerWidth,
    scrolled: seen("body *").filter((e) => e.scrollWidth > e.clientWidth + 1
      && ["auto", "scroll"].includes(getComputedStyle(e).overflowX))
      .map((e) => e.id || e.className),
    events: document.querySelectorAll("#events li").length,
  };
}"""


class Watched(Page):
    """The one page of all situations; its clock and the server's stand still."""

    def __init__(self, context, screen):
        super().__init__(context, screen.url)
        self.screen = screen

    def choose(self, name):
        self.page.wait_for_selector(f"#vehicle option[value={name}]", state="attached")
        self.page.select_option("#vehicle", name)
        self.settle(name)

    def settle(self, name):
        """Wait until the vehicle is on the page, and everything drawn."""
        self.wait("n => dfvsScreen().watched === n && dfvsScreen().refreshes > 2", name)
        self.page.wait_for_timeout(100)  # plots are drawn sixteen times a second

    def dress(self, size, theme):
        self.page.set_viewport_size({"width": size[0], "height": size[1]})
        self.page.emulate_media(color_scheme=theme)

    def keep(self, name):
        if folder := os.environ.get("DFVS_SCREENSHOTS"):
            self.page.screenshot(path=Path(folder) / f"{name}.png", full_page=True)

    def look(self):
        return self.page.evaluate(LOOK)

    def let_time_pass(self, seconds):
        self.page.evaluate(
            "ms => sessionStorage.setItem('frozen', performance.now() + ms)", seconds * 1000
        )


@pytest.fixture(scope="module")
def screen():
    screen = Screen()
    yield screen
    screen.stop()


@pytest.fixture(scope="module")
def page(chromium, screen):
    context = chromium.new_context(color_scheme="light")
    context.add_init_script(FROZEN)
    return Watched(context, screen)


def assert_ages(look, flight, *, lost_s=0.0):
    """What is old is grey and says how old; what is new is neither."""
    for source, limit_s in LIMITS_S.items():
        offset_s = 0.6 if source == "battery" else 0.0
        is_known = flight.is_seen or source in ("state", "battery")
        age_s = flight.age(source) + offset_s + lost_s
        is_old = age_s > limit_s or lost_s > 0 or not is_known
        if source != "flow":  # drawn on the view, or left out
            assert set(look["grey"][source]) == {is_old}, source
        for text in look["ages"].get(source, []):
            if not is_old:
                assert text in ("", "under 1 s old", f"{age_s:.1f} s old"), source
            elif is_known:
                assert abs(float(re.fullmatch(r"([\d.]+) s old", text)[1]) - age_s) < 0.3, source
            else:
                assert text in ("", "no data"), source

    for source, text in zip(("view", "results", "state", "flow"), look["links"], strict=False):
        assert text == (
            f"{flight.age(source) + lost_s:.1f} s" if has_heartbeat(flight, source) else "never"
        )


def has_heartbeat(flight, source):
    return flight.is_seen or source == "state"


def assert_agreement(look, name):
    """Header, title and card say the same."""
    assert look["picked"] == f"{name} – {look['state']}"
    assert look["title"] == f"{look['state']} {name}"


def test_before_any_vehicle_nothing_is_green(page):
    page.wait("() => dfvsScreen().refreshes > 2")
    page.keep("no-vehicle")
    look = page.look()
    assert look["green"] == []
    assert look["state"] == "no data"
    assert all(all(greys) for greys in look["grey"].values()), look["grey"]
    assert "Waiting for" in page.text("cause")
    assert look["server"] == "no vehicle"


@pytest.mark.parametrize("situation", SITUATIONS, ids=lambda situation: situation.name)
def test_nothing_old_looks_fresh(page, screen, situation):
    flight, name = situation.flight, situation.name
    page.dress(situation.size, situation.theme)
    screen.show(name, flight)
    if situation.late:
        page.page.reload()
    page.choose(name)
    page.wait("n => document.querySelectorAll('.uplot').length === n", 10 if flight.is_seen else 0)
    page.wait("seen => dfvsScreen().has.view === seen", flight.is_seen)
    page.wait("n => dfvsScreen().refreshes > n", page.page.evaluate("dfvsScreen().refreshes"))
    look = page.look()
    page.keep(name)
    assert_ages(look, flight)
    assert_agreement(look, name)
    assert (look["verdict"] == "✓ valid") is situation.may_be_flown
    if flight.age("state") > LIMITS_S["state"]:
        assert look["green"] == []
        assert look["state"] == f"STALE: was {flight.state}"
    else:
        assert look["state"].startswith(flight.state)
        assert look["server"] == "live"
    assert situation.says in page.page.inner_text("body")
    assert look["tooWide"] <= 0
    assert look["scrolled"] == []
    assert look["events"] == flight.changes
    assert page.complaints == []


def test_of_two_vehicles_each_is_as_old_as_it_is(page, screen):
    page.dress(DESKTOP, "light")
    gone = silent(long_over(ABORT, 21.0), 20.0)
    screen.show("heron", SERVO)
    screen.show("swift", gone)
    page.choose("heron")
    page.keep("two-watching-the-live-one")
    options = page.page.eval_on_selector_all("#vehicle option", "l => l.map(e => e.textContent)")
    assert {"heron – SERVO", "swift – STALE: was ABORT"} <= set(options)
    page.choose("swift")
    page.keep("two-watching-the-silent-one")
    assert_ages(page.look(), gone)
    assert page.look()["green"] == []


def test_plots_tell_values_under_the_pointer_and_zoom_and_go_back(page, screen):
    screen.show("zoomed", SERVO)
    page.choose("zoomed")
    chart = page.page.locator(".u-over").first.bounding_box()
    middle = chart["y"] + chart["height"] / 2
    page.page.mouse.move(chart["x"] + 0.3 * chart["width"], middle)
    page.wait("() => document.getElementById('plot-time').textContent.includes('SERVO')")
    values = page.page.eval_on_selector_all(".plot h3 b", "l => l.map(e => e.textContent)")
    assert all(re.fullmatch(r" -?[\d.e]+", value) for value in values), values
    page.keep("plot-values")
    page.page.mouse.down()
    page.page.mouse.move(chart["x"] + 0.6 * chart["width"], middle, steps=4)
    page.page.mouse.up()
    page.page.wait_for_selector("#unzoom", state="visible")
    page.keep("plot-zoomed")
    page.page.click("#unzoom")
    page.page.wait_for_selector("#unzoom", state="hidden")


def test_an_operator_is_asked_before_the_view_becomes_the_goal_and_reads_the_answer(page, screen):
    screen.show("asked", HOLD)
    page.sign_in(TOKEN)
    page.choose("asked")
    page.page.click("#take-view:enabled")
    assert "roll 3.4° and pitch -2.3°" in page.text("confirm-text")
    page.keep("take-view")
    page.page.click("#confirm-ok")
    page.wait("() => document.getElementById('answer').dataset.ok === 'no'")  # no vehicle answers
    page.dress(PHONE, "dark")
    page.page.wait_for_timeout(300)
    page.keep("take-view-answer-phone")
    assert page.look()["tooWide"] <= 0
    page.dress(DESKTOP, "light")
    for number, flight in enumerate((SERVO, silent(HOLD, 5.0, "view"))):
        screen.show(f"refused-{number}", flight)
        page.choose(f"refused-{number}")
        assert page.page.is_disabled("#take-view")
    page.page.click("#sign")
    page.page.wait_for_selector("#operator", state="hidden")


def test_on_a_small_phone_long_causes_and_warnings_leave_room_for_the_view(page, screen):
    page.dress((360, 640), "light")
    flight = Flight("PREFLIGHT", "a reason, " * 30, fields={"warnings": ("a warning, " * 20,) * 3})
    screen.show("wordy", flight)
    page.choose("wordy")
    page.sign_in(TOKEN)
    page.page.evaluate("document.getElementById('view-panel').scrollIntoView()")
    page.wait_text("warning-count", "⚠ 3")
    page.keep("wordy-phone")
    card = page.page.locator(".state-now").bounding_box()
    assert card["y"] >= 0
    assert page.page.locator("#operator").bounding_box()["y"] - card["y"] - card["height"] > 320
    page.page.click("#cause")
    assert page.page.locator(".state-now").bounding_box()["height"] > 2 * card["height"]
    page.page.click("#warning-count")
    page.wait("() => { const y = warnings.getBoundingClientRect().y; return y > 0 && y < 320; }")
    page.page.click("#sign")
    page.page.wait_for_selector("#operator", state="hidden")


def test_after_the_servers_loss_everything_is_old_until_it_is_back(page, screen):
    screen.show("lost", DONE)
    page.choose("lost")
    screen.stop()
    page.wait_text("server", "reconnecting")
    page.let_time_pass(8.0)
    page.page.wait_for_selector("#alarm", state="visible")
    count = page.page.evaluate("dfvsScreen().refreshes")
    page.wait("n => dfvsScreen().refreshes > n + 8", count)  # tables are renewed less often
    for size, theme in ((DESKTOP, "light"), (DESKTOP, "dark"), (PHONE, "light"), (PHONE, "dark")):
        page.dress(size, theme)
        page.page.wait_for_timeout(150)
        page.keep(f"server-lost-{size[0]}-{theme}")
        look = page.look()
        assert_ages(look, DONE, lost_s=8.0)
        assert look["green"] == []
        assert look["state"] == "STALE: was DONE"
        assert_agreement(look, "lost")
    page.let_time_pass(-8.0)
    screen.start()
    screen.show("lost", DONE)
    page.settle("lost")
    page.page.wait_for_selector("#alarm", state="hidden")
    page.wait_text("server", "live")
    assert_ages(page.look(), DONE)
