"""Lines of progress: rewritten in a terminal, silent elsewhere."""

import io
import sys

import pytest

from dfvs_common.progress import StatusLine, log, warn


class Terminal(io.StringIO):
    def isatty(self):
        return True


@pytest.fixture
def terminal():
    return Terminal()


def test_a_line_is_rewritten_and_erased(terminal):
    line = StatusLine(terminal)
    line.show("1 of 2")
    line.show("2 of 2")
    line.clear()
    assert terminal.getvalue() == "\r\x1b[K1 of 2\r\x1b[K2 of 2\r\x1b[K"


def test_what_follows_an_ended_line_is_below_it(terminal):
    line = StatusLine(terminal)
    line.show("done")
    line.end()
    assert terminal.getvalue().endswith("done\n")


def test_texts_that_follow_too_soon_are_left_out(terminal):
    line = StatusLine(terminal, interval_s=60.0)
    line.show("first")
    line.show("second")
    assert "second" not in terminal.getvalue()


def test_a_file_gets_nothing():
    file = io.StringIO()
    line = StatusLine(file)
    line.show("1 of 2")
    line.clear()
    line.end()
    assert file.getvalue() == ""


def no_space(*_):
    raise OSError("No space left on device")


def test_a_standard_error_that_takes_nothing_ends_no_work(monkeypatch):
    full = Terminal()
    monkeypatch.setattr(full, "flush", no_space)
    monkeypatch.setattr(sys, "stderr", full)
    log("a line")
    warn("a doubt")


def test_a_terminal_that_is_gone_ends_no_work(terminal, monkeypatch):
    monkeypatch.setattr(terminal, "write", no_space)
    line = StatusLine(terminal)
    line.show("1 of 2")
    line.clear()
    line.end()
