"""The journal of inputs as the gate writes it, and the command that replays one."""

import json
import os
from pathlib import Path

import pytest
from gate_rehearsal import Rehearsal, auto_config

from dfvs_core.gate.config import S
from dfvs_core.gate.events import VehicleMode
from dfvs_core.gate.replay import encode_start, read_steps, replay
from dfvs_core.gate.states import ENGAGED, GateState
from dfvs_service.cli import main
from dfvs_service.gate.input_journal import MAX_WAITING, InputJournal


class Journalled(Rehearsal):
    """A rehearsal of which the service's own journal is written."""

    def write_to(self, path, **options):
        self.reported = []
        self.journal = InputJournal(path, self.config, self.now_ns, self.reported.append, **options)
        return self

    def send(self, events):
        output = super().send(events)
        self.journal.add(self.now_ns, events, output, is_flight=self.state in ENGAGED)
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


@pytest.mark.parametrize("earlier_s", [None, 2])
def test_times_of_a_replay_are_since_the_start_of_the_flight(journal, capsys, earlier_s):
    start_ns = json.loads(journal.read_text().partition("\n")[0])["t_ns"]
    if earlier_s is not None:
        header = {"started_ns": start_ns - earlier_s * S}
        (journal.parent / "flight.json").write_text(json.dumps(header) + "\n")
    assert main(["replay-gate", "--json", str(journal)]) == 0
    transitions = json.loads(capsys.readouterr().out)["transitions"]
    assert main(["replay-gate", str(journal)]) == 0
    *lines, _ = capsys.readouterr().out.splitlines()
    expected = [(t["t_ns"] - start_ns) / S + (earlier_s or 0) for t in transitions]
    assert [float(line.split()[0]) for line in lines] == pytest.approx(expected, abs=5e-4)


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
    line = refused(main, "replay-gate", path)
    assert str(path) in line
    assert "; expected the gate-inputs.jsonl of a flight" in line


def test_a_full_disk_ends_the_journal_and_stops_nobody():
    gate = Journalled(auto_config()).write_to(Path("/dev/full"))  # accepts no byte
    gate.until(GateState.SERVO)
    assert gate.journal.has_ended
    assert gate.reported == ["the gate keeps no more of full: No space left on device"]
    gate.journal.close()


def test_a_slow_disk_ends_the_journal_and_blocks_nobody(tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)  # opened, and never read
    gate = Journalled(auto_config()).write_to(pipe)
    for _ in range(2 * MAX_WAITING):
        gate.tick()
    assert gate.journal._lost > 0
    assert gate.reported == ["the gate keeps no more of pipe: the disk is too slow"]
    gate.journal.close(0.05)
    os.close(reader)


def test_the_journal_ends_at_its_greatest_size_and_says_so(tmp_path):
    path = tmp_path / "journal"
    start = len(encode_start(auto_config(), 0))
    gate = Journalled(auto_config()).write_to(path, max_bytes=2 * start + 20_000)
    gate.until(GateState.SERVO).journal.close(5.0)
    assert gate.reported == ["the gate keeps no more of journal: it is as large as it may be"]
    assert path.stat().st_size <= 2 * start + 20_000
    with path.open() as lines:
        result = replay(lines)
    assert 0 < result.steps < 200
    assert result.gap == f"1 or more steps are missing after step {result.steps}"


def test_a_flight_after_a_long_wait_is_in_the_journal(tmp_path):
    path = tmp_path / "journal"
    gate = Journalled(auto_config()).write_to(path, max_bytes=900_000)
    gate.vehicle.in_air = False
    gate.run(20.0)
    gate.vehicle.in_air = True
    gate.until(GateState.SERVO)
    gate.beat(mode=VehicleMode.POSITION)
    assert gate.state is GateState.RELEASED
    released_ns = gate.now_ns
    gate.run(10.0)
    gate.journal.close(5.0)
    assert gate.reported == []
    with path.open() as file:
        lines = file.readlines()
    steps = list(read_steps(lines[1:]))
    gap, last = (i for i, step in enumerate(steps) if isinstance(step, int))
    assert last == len(steps) - 1
    flight = steps[gap + 1 : last]
    changes = [(step.t_ns, to[1]) for step in flight for to in step.encoded.get("to", [])]
    assert [state for _, state in changes] == ["ENGAGE", "SERVO", "RELEASED"]
    assert flight[0].t_ns == pytest.approx(changes[0][0] - 5 * S, abs=S // 10)
    assert flight[-1].t_ns == pytest.approx(released_ns + 5 * S, abs=S // 10)
    assert replay(lines).gap.startswith(f"{steps[gap]} or more steps are missing")
