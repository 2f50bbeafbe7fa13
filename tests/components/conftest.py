"""What tests of several components use."""

import pytest
from browser_page import CHROMIUM
from loopback import listening_peer


@pytest.fixture(scope="module")
def chromium():
    """A browser for all pages of a module."""
    sync_api = pytest.importorskip("playwright.sync_api")
    with sync_api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield browser
        browser.close()


@pytest.fixture
def service():
    """Perception's end: a Zenoh peer that listens, and where."""
    with listening_peer() as peer:
        yield peer
