"""What the page does when its connection is lost, refused, or made anew."""

import pytest
from browser_page import CHROMIUM, needs_chromium
from scripted_server import ScriptedServer

sync_api = pytest.importorskip("playwright.sync_api")
pytestmark = needs_chromium

WATCHED = "name => dfvsScreen().watched === name"


@pytest.fixture(scope="module")
def chromium():
    with sync_api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield browser
        browser.close()


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
