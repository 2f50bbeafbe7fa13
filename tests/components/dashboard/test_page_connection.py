"""What the page does when its connection is lost, refused, or made anew."""

import base64

import numpy as np
import pytest
from browser_page import needs_chromium
from scripted_server import TOKEN, ScriptedServer

from dfvs_core.messages.image import encode_jpeg

pytestmark = needs_chromium

HELD = {"command": "hold", "vehicle": "swift", "accepted": True, "text": "accepted: hold"}
WATCHED = "name => dfvsScreen().watched === name"


@pytest.fixture(scope="module")
def page(chromium):
    """A page whose modules are imported and tried by themselves."""
    context = chromium.new_context()
    yield ScriptedServer(context, "swift").page.page
    context.close()


@pytest.fixture
def serve(chromium):
    contexts = []

    def serve(*vehicles):
        contexts.append(chromium.new_context())
        return ScriptedServer(contexts[-1], *vehicles)

    yield serve
    for context in contexts:
        context.close()


def test_a_restarted_server_that_does_not_know_the_vehicle_yet_is_asked_for_no_other(serve):
    server = serve("swift")
    server.until(lambda: server.watched == ["swift"])
    server.vehicles = ("heron",)
    server.close()
    server.page.page.wait_for_selector("#vehicle option[value=heron]", state="attached")
    assert server.watched == []
    assert server.page.page.input_value("#vehicle") == "swift"
    server.list_vehicles("heron", "swift")
    server.until(lambda: server.watched == ["swift"])


def test_a_vehicle_that_the_user_chooses_is_asked_for(serve):
    server = serve("heron", "swift")
    server.until(lambda: server.watched == ["heron"])
    server.page.page.wait_for_selector("#vehicle option[value=swift]", state="attached")
    server.page.page.select_option("#vehicle", "swift")
    server.until(lambda: server.watched == ["heron", "swift"])
    server.close()
    server.until(lambda: server.watched == ["swift"])
    server.page.wait(WATCHED, "swift")


def test_what_is_shown_of_a_vehicle_is_not_called_another_one_s_without_a_connection(serve):
    server = serve("heron", "swift")
    server.page.wait_text("server", "live")
    server.accepts = False
    server.socket.close(code=1001)
    server.page.page.wait_for_selector("#alarm", state="visible")
    server.page.page.select_option("#vehicle", "swift")
    server.page.wait_text("state", "no data")
    assert "SERVO" not in server.page.page.title()


DECODED_LATE = """async (jpeg) => {
  const { View } = await import("./view.js");
  const place = document.body.appendChild(document.createElement("div"));
  const view = new View(place.appendChild(document.createElement("canvas")), () => 0);
  const image = { captureMs: 1, data: Uint8Array.from(atob(jpeg), (c) => c.charCodeAt(0)) };
  const taken = [1, 1, 2].map((kind) => view.take({ kind, ...image }));
  view.clear();
  await Promise.all(taken);
  const kept = view.stats.has;
  await view.take({ kind: 1, ...image });
  return [kept.view, kept.goal, view.stats.has.view];
}"""


def test_an_image_that_is_decoded_after_another_vehicle_was_chosen_is_not_shown(page):
    jpeg = base64.b64encode(encode_jpeg(np.zeros((48, 64, 3), np.uint8))).decode()
    assert page.evaluate(DECODED_LATE, jpeg) == [False, False, True]


HEADING = """async (yaw_rad) => {
  const { showInstruments } = await import("./instruments.js");
  showInstruments({ yaw_rad, roll_rad: 0, pitch_rad: 0, down_m: 0 });
  return document.getElementById("heading").textContent;
}"""


@pytest.mark.parametrize(("yaw_rad", "shown"), [(-1.571, "270°"), (-0.001, "0°"), (3.142, "180°")])
def test_headings_are_those_of_a_compass(page, yaw_rad, shown):
    assert page.evaluate(HEADING, yaw_rad) == shown


def test_a_warning_about_the_vehicle_s_name_is_shown(serve):
    server = serve("swift")
    server.until(lambda: server.watched == ["swift"])
    server.say(zenoh={"connected": 2, "links": 2, "warnings": {"swift": "two of one name"}})
    server.page.wait_text("warnings", "two of one name")


def test_a_silent_vehicle_is_announced_once(serve):
    server = serve("swift")
    server.page.wait_text("server", "live")
    server.page.page.evaluate(
        "globalThis.changes = []; new MutationObserver((list) => changes.push(...list))"
        ".observe(document.getElementById('server'), { childList: true, characterData: true })"
    )
    server.page.wait_text("state", "STALE: was SERVO")
    server.page.page.wait_for_timeout(1000)  # five refreshes of the page
    assert server.page.page.evaluate("changes.length") == 1
    assert server.page.text("server") == "silent"


AFTER_A_STEP = """async (stepMs) => {
  const { Connection } = await import("./connection.js");
  const { clock } = new Connection("");
  const here = () => performance.timeOrigin + performance.now();
  for (const roundTrip of [3, 4, 5]) clock.add(here() - roundTrip, here(), here());
  clock.add(here() - 40, here() + stepMs, here());
  return clock.now() - here();
}"""


@pytest.mark.parametrize("step_ms", [3_600_000, -20_000, 0])
def test_a_clock_that_was_set_is_followed_from_the_next_ping_on(page, step_ms):
    shift_ms = page.evaluate(AFTER_A_STEP, step_ms)
    assert shift_ms == pytest.approx(step_ms, abs=25.0)  # half of the slowest ping, and 5 ms


PLOTTED = """async ([times, marks]) => {
  const { Plots } = await import("./plots.js");
  const plots = new Plots(document.body, () => 0);
  plots.show(0);
  plots.mark(marks.map((t) => ({ t_ms: t * 1e3, to: "SERVO" })));
  const row = { error_m: 1.0, error_rad: 0.1, error_spread_m: 0.1, setpoint: [], flown: [] };
  for (const [source, t] of times) plots.add(source, { t_ms: t * 1e3, ...row });
  return [plots.rangeS, plots.markers.map((marker) => marker.t_ms / 1e3)];
}"""


@pytest.mark.parametrize(
    ("times_s", "marks_s", "shown_s", "marked_s"),
    [
        ((100, 101, 102, 40, 50), (30, 99, 40.5), [40, 50], [40.5]),
        ((100, 101, 102, 40, 50), (30, 99), [40, 50], []),
        ((40, 50), (30, 99, 40.5), [40, 50], [40.5]),
        ((100, 101, 100.5, 110), (30, 99, 98.5), [100, 110], [30, 99, 98.5]),
    ],
)
def test_rows_and_states_from_before_the_clock_was_set_back_are_shown_no_longer(
    page, times_s, marks_s, shown_s, marked_s
):
    """Those that another one has overtaken are."""
    times = [("vehicle", t_s) for t_s in times_s]
    assert page.evaluate(PLOTTED, [times, marks_s]) == [shown_s, marked_s]


def test_results_that_ended_before_the_clock_was_set_back_hold_up_no_plot(page):
    times = [("results", 100), ("vehicle", 100), ("vehicle", 40), ("vehicle", 50)]
    assert page.evaluate(PLOTTED, [times, []]) == [[40, 50], []]


OLD = """async (aheadMs) => {
  const { assess } = await import("./freshness.js");
  const state = { state: "SERVO", t_ms: 1e6 + aheadMs };
  return assess({ state }, 1e6, { isOpen: true, lostMs: 0 }).old.state;
}"""


@pytest.mark.parametrize(("ahead_ms", "is_old"), [(-100, False), (1000, False), (60_000, True)])
def test_a_state_from_before_the_clock_was_set_back_is_not_live(serve, ahead_ms, is_old):
    assert serve("swift").page.page.evaluate(OLD, ahead_ms) is is_old


@pytest.fixture
def operated(serve):
    """A server of one vehicle, with an operator who has signed in."""
    server = serve("swift")
    server.until(lambda: server.watched == ["swift"])
    server.page.sign_in(TOKEN)
    server.until(lambda: server.watched == ["swift"])
    return server


def test_a_command_without_a_connection_is_called_not_sent(operated):
    operated.accepts = False
    operated.socket.close(code=1001)
    operated.page.page.wait_for_selector("#alarm", state="visible")
    operated.page.page.keyboard.press("Shift+A")
    operated.page.wait_text("answer", "swift: abort NOT sent: no connection")
    assert operated.page.page.get_attribute("#answer", "data-ok") == "no"
    assert operated.commands == []


def test_a_command_whose_connection_is_lost_is_called_not_answered(operated):
    operated.page.page.keyboard.press("Shift+H")
    operated.until(lambda: operated.commands == [("swift", "hold")])
    operated.page.wait_text("answer", "swift: hold sent …")
    operated.close()
    operated.page.wait_text("answer", "swift: hold not answered: connection lost")


def test_an_answer_stays_when_the_connection_is_lost(operated):
    operated.page.page.keyboard.press("Shift+H")
    operated.until(lambda: operated.commands)
    operated.say(answers=[HELD])
    operated.page.wait_text("answer", "swift: accepted: hold")
    operated.close()
    operated.page.wait_text("answer", "swift: accepted: hold")


def test_an_answer_goes_when_another_vehicle_is_watched(operated):
    operated.say(answers=[HELD])
    operated.page.wait_text("answer", "swift: accepted: hold")
    operated.list_vehicles("heron", "swift")
    operated.page.page.wait_for_selector("#vehicle option[value=heron]", state="attached")
    operated.page.page.select_option("#vehicle", "heron")
    operated.page.wait(WATCHED, "heron")
    assert operated.page.text("answer") == ""


def test_hold_and_abort_have_their_keys_wherever_the_focus_is_and_with_caps_lock(operated):
    page = operated.page.page
    page.click("text=Slider")
    for focus in (
        lambda: page.click("text=Side by side"),
        lambda: page.click("text=2 min"),
        lambda: page.focus("#vehicle"),
        lambda: page.click("text=Slider") or page.focus("#mix"),
    ):
        focus()
        page.keyboard.press("Shift+A")
        operated.until(lambda: operated.commands == [("swift", "abort")], patience_s=2.0)
        operated.commands.clear()
    page.evaluate(
        "document.activeElement.dispatchEvent("
        "new KeyboardEvent('keydown', { key: 'h', shiftKey: true, bubbles: true }))"
    )
    operated.until(lambda: operated.commands == [("swift", "hold")], patience_s=2.0)


def test_a_goal_without_a_connection_is_called_not_sent(operated):
    image = {"name": "b.jpg", "mimeType": "image/jpeg", "buffer": b"\xff\xd8"}
    operated.say(state=operated.state() | {"state": "READY"})
    operated.page.page.wait_for_selector("#goal:enabled")
    operated.page.page.set_input_files("#goal-files", [image])
    operated.accepts = False
    operated.socket.close(code=1001)
    operated.page.page.wait_for_selector("#alarm", state="visible")
    operated.page.page.click("#confirm-ok")
    operated.page.wait_text("answer", "swift: goal NOT sent: no connection")


def test_a_goal_that_is_too_large_is_not_sent_and_the_limit_is_named(operated):
    image = {"name": "b.png", "mimeType": "image/png", "buffer": bytes(1_200_000)}
    operated.say(state=operated.state() | {"state": "READY"})
    operated.page.page.wait_for_selector("#goal:enabled")
    operated.page.page.set_input_files("#goal-files", [image])
    expected = "not sent: b.png has 1.2 MB, a goal at most 0.8 MB; send it as JPEG"
    operated.page.wait_text("answer", expected)
    assert not operated.page.page.is_visible("#confirm-dialog")


def test_after_a_wrong_token_and_cancel_the_page_looks_on_without_one(serve):
    server = serve("swift")
    server.until(lambda: server.watched == ["swift"])
    server.page.page.click("#sign")
    server.page.page.fill("#token", "mistyped")
    server.page.page.keyboard.press("Enter")
    server.until(lambda: server.tokens[-1] == "mistyped")
    server.page.wait("() => document.getElementById('sign-why').textContent.includes('wrong')")
    server.page.page.click("#sign-dialog [data-close]")
    server.until(lambda: server.tokens[-1] == "")
    server.until(lambda: server.watched == ["swift"])


def test_a_page_that_was_too_slow_to_greet_connects_again_with_its_token(operated):
    operated.close(code=4408, reason="no greeting came")
    assert operated.tokens[-1] == TOKEN
    assert not operated.page.page.is_visible("#sign-dialog")
