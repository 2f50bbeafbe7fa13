"""What tests of several components use."""

import pytest
from browser_page import CHROMIUM


@pytest.fixture(scope="module")
def chromium():
    """A browser for all pages of a module."""
    sync_api = pytest.importorskip("playwright.sync_api")
    with sync_api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield browser
        browser.close()
