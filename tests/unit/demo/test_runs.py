"""Runs of several flights, some of which cannot be brought up."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from dfvs_core.errors import ConfigError, DfvsError
from dfvs_sim.demo import cli, runs
from dfvs_sim.demo.flight.flight import FlightError, NotReadyError
from dfvs_sim.demo.plan import FlightPlan
from dfvs_sim.ground.pilot import PilotError
from dfvs_sim.ground.systems import LinkError

ERRORS: tuple[DfvsError, ...] = (
    NotReadyError("the goal is not in view"),
    PilotError("arming was denied"),
    LinkError("the vehicle did not answer command 22"),
    FlightError("dfvs-service ended at once:\nno model"),
)


@pytest.fixture
def begun(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Seeds of the flights that were begun; each ends with an error of its own."""
    seeds: list[int] = []

    class Flight:
        def __init__(self, plan: FlightPlan, *_: object) -> None:
            self.seed = plan.seed

        def run(self, _: Callable[..., None]) -> None:
            seeds.append(self.seed)
            raise ERRORS[self.seed]

    monkeypatch.setattr(runs, "Flight", Flight)
    return seeds


def fly(folder: Path, *words: str) -> int:
    poses = "--start", "0,0,-1.3,0", "--goal", "0.8,0.4,-1.2,20", "--size", "96x72"
    return cli.main([*poses, "--no-report", "--out", str(folder / "out"), *words])


def test_a_flight_that_cannot_be_brought_up_does_not_end_the_others(
    begun: list[int], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert fly(tmp_path, "--runs", "4", "--json", str(tmp_path / "seeds.json")) == 1
    assert begun == [0, 1, 2, 3]
    documents: list[dict[str, Any]] = json.loads((tmp_path / "seeds.json").read_text())
    assert [d["end_cause"] for d in documents] == [str(error) for error in ERRORS]
    assert {d["end_state"] for d in documents} == {"NOT READY"}
    assert not any(d["converged"] for d in documents)
    assert [d["final_translation_m"] for d in documents] == [None] * 4
    one = json.loads((tmp_path / "out" / "seed-1" / "summary.json").read_text())
    assert one == documents[1]
    table = capsys.readouterr().out
    assert "NOT READY: arming was denied" in table
    assert "NOT READY: dfvs-service ended at once: no model" in table
    assert "0 of 4 converged" in table


def test_a_single_flight_that_cannot_be_brought_up_is_an_error(
    begun: list[int], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert fly(tmp_path, "--seed", "1") == 2
    assert begun == [1]
    assert "error: arming was denied" in capsys.readouterr().err


def test_an_error_that_every_flight_would_meet_ends_the_run(
    begun: list[int], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    refused = ConfigError("cannot listen on UDP 127.0.0.1:14550")
    monkeypatch.setitem(globals(), "ERRORS", (refused, refused))
    assert fly(tmp_path, "--runs", "2") == 2
    assert begun == [0]
