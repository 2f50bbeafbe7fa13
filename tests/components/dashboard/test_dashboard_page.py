"""The dashboard's page in a real browser, fed by real telemetry."""

import json

import pytest
from browser_page import Page, needs_chromium
from dashboard_server import Server
from loopback import free_endpoint
from telemetry_vehicle import TelemetryVehicle

from dfvs_core.messages.goal_command import GoalCommand
from dfvs_core.messages.image import encode_jpeg

pytestmark = [needs_chromium, pytest.mark.real_time]

FRAMES = "dfvsScreen().frames"
PIXELS = """() => {
  const shown = document.getElementById("view");
  const copy = new OffscreenCanvas(160, 60).getContext("2d", { willReadFrequently: true });
  copy.drawImage(shown, 0, 0, 160, 60);
  const data = copy.getImageData(0, 0, 160, 60).data;
  let sum = 0, hash = 0;
  for (const value of data) { sum += value; hash = (hash * 31 + value) | 0; }
  return { brightness: sum / data.length, hash };
}"""
BAND_PIXELS = """() => {
  const { width, height } = document.querySelector("#plots canvas");
  const context = document.querySelector("#plots canvas").getContext("2d");
  const data = context.getImageData(0, 0, width, height).data;
  const filled = (i) => data[i + 3] > 50 && data[i + 3] < 120 && data[i + 2] > data[i] + 80;
  let count = 0;  // translucent and blue, as are all around: neither lines, their rims, nor axes
  for (let i = 4 * width; i < data.length - 4 * width; i += 4)
    count += [i, i - 4, i + 4, i - 4 * width, i + 4 * width].every(filled);
  return count;
}"""
NUMBER = """name => [...document.querySelectorAll("#numbers div")]
  .find((e) => e.firstChild.firstChild.textContent === name)?.lastChild.textContent ?? ''"""
WRITTEN_ON_PATH = """() => {
  window.written = {};
  const write = CanvasRenderingContext2D.prototype.fillText;
  CanvasRenderingContext2D.prototype.fillText = function (text, x, y) {
    const { width, height } = this.canvas, wide = this.measureText(text).width;
    const left = this.textAlign === "center" ? x - wide / 2 : x;
    if (this.canvas.id === "path")
      window.written[text] = left >= 0 && left + wide <= width && y > 0 && y < height;
    return write.apply(this, arguments);
  };
}"""
NAMELESS = """() => [...document.querySelectorAll(
  'button, input, select, canvas:not(.uplot canvas), dialog, section')].filter((e) => !(
    e.getAttribute('aria-label') || e.getAttribute('aria-labelledby')
    || e.textContent.trim() || e.labels?.length)).map((e) => e.outerHTML)"""


class LivePage(Page):
    """A page that shows a vehicle whose pictures move."""

    def pixels(self):
        return self.page.evaluate(PIXELS)

    def frames_rise(self, by=5):
        now = self.page.evaluate(FRAMES)
        self.wait(f"n => {FRAMES} > n", now + by)


@pytest.fixture
def open_page(chromium):
    contexts = []

    def open_page(url, width=1280, height=900):
        contexts.append(chromium.new_context(viewport={"width": width, "height": height}))
        return LivePage(contexts[-1], url)

    yield open_page
    for context in contexts:
        context.close()


def watch(page, vehicle):
    page.page.wait_for_selector(f"#vehicle option[value={vehicle}]", state="attached")
    page.page.select_option("#vehicle", vehicle)
    page.wait("v => document.title.endsWith(v)", vehicle)
    page.frames_rise()


@pytest.fixture
def page(server, field, open_page):
    """A page that shows the vehicle swift."""
    page = open_page(server.url)
    watch(page, "swift")
    return page


def test_pictures_and_numbers_move_and_nothing_comes_from_elsewhere(server, page):
    first = page.pixels()
    assert first["brightness"] > 20
    page.wait(f"hash => ({PIXELS})().hash !== hash", first["hash"])
    distance = page.page.text_content("#numbers dd >> nth=0")
    page.wait("d => document.querySelector('#numbers dd').textContent !== d", distance)
    for part in ("#plots canvas", "#links tr:not(.bad)", "#delays tr", "#events li"):
        page.page.wait_for_selector(part)
    assert page.text("state") == "SERVO"
    assert page.text("cause") == "good data"
    page.frames_rise(20)
    assert all(url.startswith(server.url) for url in page.requests)
    assert page.complaints == []


def test_the_distance_has_its_standard_deviation_beside_it_and_as_a_band(page):
    page.wait(f"() => ({BAND_PIXELS})() > 300")
    for name, pattern in (
        ("Distance to goal", r"^\d\.\d{3} ± \d\.\d{3} m$"),
        ("Mean distance, 1 s", r"^\d\.\d{3} ± \d\.\d{3} m$"),
        ("Scale spread", r"^\d+\.\d %$"),
        ("Velocity error", r"^0\.0\d\d m/s$"),
    ):
        page.wait(f"([name, re]) => new RegExp(re).test(({NUMBER})(name))", [name, pattern])
    assert page.complaints == []


def test_without_an_uncertainty_there_is_neither_a_band_nor_a_spread(field, open_page):
    endpoint = free_endpoint()
    with Server([endpoint]) as server:
        vehicle = TelemetryVehicle(endpoint, "plain")
        vehicle.knows_uncertainty, vehicle.mounting_score = False, None
        with vehicle:
            page = open_page(server.url)
            watch(page, "plain")
            for name in ("Mean distance, 1 s", "Scale spread", "Velocity error", "Mounting"):
                page.wait(f"name => ({NUMBER})(name).startsWith('–')", name)
            page.wait(f"() => /^\\d\\.\\d{{3}} m$/.test(({NUMBER})('Distance to goal'))")
            page.page.wait_for_selector("#plots canvas")
            page.frames_rise(20)
            assert page.page.evaluate(BAND_PIXELS) < 50
            assert page.complaints == []


def test_the_mounting_is_ok_undecided_or_wrong_as_the_gate_judges_its_score(field, page):
    for score, text in ((12.3, "ok 12.3 σ"), (-4.9, "undecided "), (-5.0, "wrong 5.0 σ")):
        field.swift.mounting_score = score
        page.wait(f"text => ({NUMBER})('Mounting') === text", text)


def test_north_east_and_the_goal_are_told_on_the_path_however_it_is_turned(page):
    page.page.evaluate(WRITTEN_ON_PATH)
    for _ in range(4):
        page.page.evaluate("() => { window.written = {}; }")
        page.page.focus("#path")
        for _ in range(4):
            page.page.keyboard.press("ArrowLeft")
        page.wait("() => ['N', 'E', 'goal (estimate)'].every((text) => written[text])")


def test_flow_confidence_and_ways_to_compare_change_the_picture(field, page):
    page.wait("() => Object.values(dfvsScreen().has).every(Boolean)")
    field.swift.pause_halfway()
    page.wait("() => !document.getElementById('view-notice').hidden")
    seen = {page.pixels()["hash"]}
    for key in ("f", "c", "2", "ArrowLeft", "3", "4", "f", "1"):
        page.page.keyboard.press(key)
        page.wait(f"seen => !seen.includes(({PIXELS})().hash)", list(seen))
        seen.add(page.pixels()["hash"])


def test_old_data_are_called_old_and_new_ones_clear_that(field, page):
    field.swift.is_paused = True
    page.wait_text("state", "STALE: was SERVO")
    assert "Nothing heard since" in page.text("cause")
    assert page.page.title().startswith("STALE")
    page.wait("() => !document.getElementById('view-notice').hidden")
    assert "NO NEW IMAGE" in page.text("view-notice")
    field.swift.is_paused = False
    page.wait_text("state", "SERVO")
    page.page.wait_for_selector("#view-notice", state="hidden")


OPACITY = "() => getComputedStyle(document.querySelector('#numbers dd')).opacity"
GOOD = "() => document.getElementById('verdict').dataset.ok === 'yes'"
NOT_GOOD = "text => (e => e.dataset.ok !== 'yes' && e.textContent.includes(text))(verdict)"


def test_may_be_flown_is_green_only_while_it_is_true(field, open_page):
    with Server(field.endpoints) as server:
        page = open_page(server.url)
        watch(page, "swift")
        page.wait(GOOD)
        assert page.text("verdict") == "✓ valid"
        field.swift.enter("ABORT", "goal lost")
        page.wait(NOT_GOOD, "the gate is in ABORT")
        field.swift.enter("SERVO", "good data")
        page.wait(GOOD)
        field.swift.is_paused = True
        page.wait(NOT_GOOD, "s old")
        assert page.page.evaluate(OPACITY) == "0.6"
        field.swift.is_paused = False
        page.wait(GOOD)
        assert page.page.evaluate(OPACITY) == "1"
        server.kill()
        page.wait(NOT_GOOD, "s old")


def test_it_reconnects_by_itself_after_the_server_was_killed(field, open_page):
    with Server(field.endpoints) as server:
        page = open_page(server.url)
        watch(page, "heron")
        server.kill()
        page.page.wait_for_selector("#alarm", state="visible")
        assert page.text("server") == "reconnecting"
        assert "What you see is old" in page.text("alarm")
        server.start()
        page.page.wait_for_selector("#alarm", state="hidden")
        page.frames_rise()
        assert page.page.input_value("#vehicle") == "heron"
        assert page.text("state") == "SERVO"


def test_an_operator_signs_in_and_holds_and_engages_after_a_question(field, page):
    assert page.page.is_hidden("#operator")
    page.sign_in(field.token)
    page.page.click("#hold:enabled")
    page.wait_text("answer", "swift: accepted: hold")
    page.wait_text("state", "HOLD")
    page.page.click("#engage:enabled", timeout=5_000)
    page.page.click("#confirm-cancel")
    page.page.click("#engage:enabled")
    page.page.click("#confirm-ok")
    page.wait_text("state", "SERVO")
    assert field.swift.orders[-2:] == ["accepted: hold", "accepted: engage"]
    page.page.click("#sign")
    page.page.wait_for_selector("#operator", state="hidden")


def test_an_operator_changes_the_goal_to_a_picture_with_its_sidecar(field, page):
    page.sign_in(field.token)
    field.swift.enter("READY", "checks passed")
    picture, sidecar = encode_jpeg(field.swift.views[0]), '{"format": "dfvs-goal/1"}'
    page.page.wait_for_selector("#goal:enabled")
    files = [
        {"name": "b.jpg", "mimeType": "image/jpeg", "buffer": picture},
        {"name": "b.json", "mimeType": "application/json", "buffer": sidecar.encode()},
    ]
    page.page.set_input_files("#goal-files", files)
    page.page.click("#confirm-ok")
    page.wait_text("answer", "swift: accepted: goal")
    assert field.swift.goals[-1] == GoalCommand(picture, sidecar)


def test_an_operator_takes_the_view_as_the_goal_with_the_attitude_of_its_capture(field, page):
    assert page.page.is_hidden("#take-view")  # a viewer may not
    page.sign_in(field.token)
    field.swift.enter("HOLD", "operator commanded to hold")
    page.page.click("#take-view:enabled")
    assert page.page.get_attribute("#confirm-image", "src").startswith("blob:")
    page.page.click("#confirm-cancel")
    page.page.click("#take-view:enabled")
    page.page.click("#confirm-ok")
    page.wait_text("answer", "swift: accepted: goal")
    order = field.swift.goals[-1]
    assert order.image in [encode_jpeg(view) for view in field.swift.views]
    attitude = json.loads(order.sidecar)
    assert attitude == {"roll_rad": pytest.approx(0.06), "pitch_rad": pytest.approx(-0.04)}


def test_a_wrong_token_is_asked_for_again(server, field, open_page):
    page = open_page(server.url)
    page.page.click("#sign")
    page.page.fill("#token", "x" * 40)
    page.page.keyboard.press("Enter")
    page.wait("() => document.getElementById('sign-why').textContent.includes('wrong token')")
    assert page.page.is_hidden("#operator")


@pytest.mark.parametrize("size", [(1440, 900), (390, 844)], ids=["laptop", "phone"])
def test_everything_fits_and_has_a_name(server, field, open_page, size):
    page = open_page(server.url, *size)
    watch(page, "swift")
    page.sign_in(field.token)
    too_wide = page.page.evaluate("document.documentElement.scrollWidth - innerWidth")
    assert too_wide <= 0
    for order in ("hold", "abort"):
        assert page.page.locator(f"#{order}").bounding_box()["height"] >= 44
    assert page.page.evaluate(NAMELESS) == []


def test_a_page_waits_for_a_vehicle_that_is_not_there_yet(open_page):
    endpoint = free_endpoint()
    with Server([endpoint]) as server:
        page = open_page(server.url)
        page.page.wait_for_selector("#cause:has-text('Waiting for a service')")
        with TelemetryVehicle(endpoint, "late"):
            watch(page, "late")
