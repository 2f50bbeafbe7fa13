"""Words for a terminal that takes them, takes none, or is gone."""

import threading

from dfvs_service.supervisor.console_writer import ConsoleWriter
from dfvs_service.supervisor.heartbeat import Heartbeat


class Terminal:
    def __init__(self):
        self.lines, self.is_open = [], threading.Event()
        self.is_open.set()
        self.closed = False

    def show(self, beat):
        self.log(beat.state)

    def log(self, line):
        self.is_open.wait()
        self.lines.append(line)

    def close(self):
        self.closed = True


def test_words_come_in_their_order_and_the_terminal_is_left_clean():
    terminal = Terminal()
    narrator = ConsoleWriter(terminal)
    narrator.show(Heartbeat(0, "READY", ""))
    narrator.log("warning: so")
    assert narrator.close(5.0)
    assert terminal.lines == ["READY", "warning: so"]
    assert terminal.closed


def test_a_stopped_terminal_blocks_nobody_and_keeps_what_must_be_said():
    terminal = Terminal()
    terminal.is_open.clear()
    narrator = ConsoleWriter(terminal)
    for number in range(1000):
        narrator.show(Heartbeat(0, f"state {number}", ""))
    narrator.log("error: the gate hung")
    assert not narrator.close(0.01)
    terminal.is_open.set()
    assert narrator.close(5.0)
    assert terminal.lines[-1] == "error: the gate hung"
    assert len(terminal.lines) < 20


def test_a_terminal_that_is_gone_does_not_silence_the_next_word():
    terminal = Terminal()
    terminal.show = lambda beat: (_ for _ in ()).throw(BrokenPipeError)
    narrator = ConsoleWriter(terminal)
    narrator.show(Heartbeat(0, "READY", ""))
    narrator.log("still here")
    assert narrator.close(5.0)
    assert terminal.lines == ["still here"]
