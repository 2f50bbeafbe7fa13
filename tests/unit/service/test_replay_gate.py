"""The journal of inputs as the gate writes it, and the command that replays one."""

import json
import os
from pathlib import Path

import pytest
from gate_rehearsal import Rehearsal, auto_config

from dfvs_core.gate.replay import encode_start, replay
from dfvs_core.gate.states import GateState
from dfvs_service.cli import main
from dfvs_service.gate.input_journal import MAX_WAITING, InputJournal


class Journalled(Rehearsal):
    """A rehearsal of which the service's own journal is written."""

    def write_to(self, path, **options):
        self.journal = InputJournal(path, self.config, self.now_ns, **options)
        return self

    def send(self, events):
        output = super().send(events)
        self.journal.add(self.now_ns, events, output)
        return output


@pytest.fixture
def journal(tmp_path):
    """A journal of a flight up to SERVO."""
    path = tmp_path / "gate-inputs.jsonl"
    gate = Journalled(auto_config()).write_to(path).until(GateState.SERVO)
    gate.journal.close(5.0)
    return path


def test_a_recorded_flight_is_decided_the_same_way_again(journal, capsys):
    assert main(["replay-gate", str(journal)]) == 0
    *transitions, last = capsys.readouterr().out.splitlines()
    assert [line.split()[4] for line in transitions][-2:] == ["ENGAGE", "SERVO"]
    assert "the gate says the same" in last


def test_a_journal_that_was_changed_is_told_from_the_real_one(journal, capsys):
    text = journal.read_text()
    journal.write_text(text.replace(",true,false]", ",false,true]"))  # it stands on the ground
    assert journal.read_text() != text
    assert main(["replay-gate", "--json", str(journal)]) == 1
    assert json.loads(capsys.readouterr().out)["difference"].startswith("step ")


@pytest.mark.parametrize("content", [None, b"", b"hello\n", b"\xff\xfe\n"])
def test_what_is_no_journal_is_said_in_one_line(content, tmp_path, refused):
    path = tmp_path / "journal"
    if content is not None:
        path.write_bytes(content)
    refused(main, "replay-gate", path)


def test_a_full_disk_ends_the_journal_and_stops_nobody():
    gate = Journalled(auto_config()).write_to(Path("/dev/full"))  # accepts no byte
    gate.until(GateState.SERVO)
    assert gate.journal.has_ended
    gate.journal.close()


def test_a_slow_disk_ends_the_journal_and_blocks_nobody(tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)  # opened, and never read
    gate = Journalled(auto_config()).write_to(pipe)
    for _ in range(2 * MAX_WAITING):
        gate.tick()
    assert gate.journal._lost > 0
    gate.journal.close(0.05)
    os.close(reader)


def test_the_journal_ends_at_its_greatest_size(tmp_path):
    path = tmp_path / "journal"
    start = len(encode_start(auto_config(), 0))
    gate = Journalled(auto_config()).write_to(path, max_bytes=start + 20_000)
    gate.until(GateState.SERVO).journal.close(5.0)
    assert path.stat().st_size <= start + 20_000
    with path.open() as lines:
        assert 0 < replay(lines).steps < 100
