"""Words for a terminal that takes them, takes none, or is gone."""

import threading

from dfvs_service.supervisor.console import ConsoleWriter
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
    console_writer = ConsoleWriter(terminal)
    console_writer.show(Heartbeat(0, "READY", ""))
    console_writer.log("warning: so")
    assert console_writer.close(5.0)
    assert terminal.lines == ["READY", "warning: so"]
    assert terminal.closed


def test_a_stopped_terminal_blocks_nobody_and_keeps_what_must_be_said():
    terminal = Terminal()
    terminal.is_open.clear()
    console_writer = ConsoleWriter(terminal)
    for number in range(1000):
        console_writer.show(Heartbeat(0, f"state {number}", ""))
    console_writer.log("error: the gate hung")
    assert not console_writer.close(0.01)
    terminal.is_open.set()
    assert console_writer.close(5.0)
    assert terminal.lines[-1] == "error: the gate hung"
    assert len(terminal.lines) < 20


def test_a_terminal_that_is_gone_does_not_silence_the_next_word():
    terminal = Terminal()
    terminal.show = lambda beat: (_ for _ in ()).throw(BrokenPipeError)
    console_writer = ConsoleWriter(terminal)
    console_writer.show(Heartbeat(0, "READY", ""))
    console_writer.log("still here")
    assert console_writer.close(5.0)
    assert terminal.lines == ["still here"]
