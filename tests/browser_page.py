"""Chromium for tests, and what a page complained about and asked for."""

import shutil

import pytest

NAMES = ("chromium", "chromium-browser", "google-chrome")
CHROMIUM = next((path for name in NAMES if (path := shutil.which(name))), None)
PATIENCE_MS = 60_000

needs_chromium = pytest.mark.skipif(
    CHROMIUM is None, reason="no Chromium on this machine (Debian: apt-get install chromium)"
)


class Page:
    """A page with everything that it complained about and asked for."""

    def __init__(self, context, url):
        self.complaints, self.requests = [], []
        self.page = context.new_page()
        self.page.set_default_timeout(PATIENCE_MS)
        self.page.on("console", self.on_console)
        self.page.on("pageerror", lambda error: self.complaints.append(str(error)))
        self.page.on("request", lambda request: self.requests.append(request.url))
        self.page.goto(url)

    def on_console(self, message):
        if message.type in ("error", "warning"):
            self.complaints.append(message.text)

    def wait(self, script, argument=None):
        self.page.wait_for_function(script, arg=argument, timeout=PATIENCE_MS, polling=100)

    def wait_text(self, element, text):
        self.wait("([e, t]) => document.getElementById(e).textContent === t", [element, text])

    def text(self, element):
        return self.page.text_content(f"#{element}")

    def sign_in(self, token):
        self.page.click("#sign")
        self.page.fill("#token", token)
        self.page.keyboard.press("Enter")
        self.wait("() => !document.getElementById('operator').hidden")
