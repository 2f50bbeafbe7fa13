"""Words of ``dfvs-sim pilot``."""

from collections.abc import Callable
from typing import cast

import pytest

from dfvs_core.errors import ConfigError
from dfvs_sim.cli import main
from dfvs_sim.commands.pilot import execute_lines, parse
from dfvs_sim.ground.pilot import Pilot, PilotError
from dfvs_sim.vehicle.modes import Mode


class ScriptedPilot:
    """Keeps what it was asked for; refuses to land."""

    def __init__(self) -> None:
        self.asked: list[object] = []

    def prepare(self) -> None:
        self.asked.append("prepare")

    def arm(self) -> None:
        self.asked.append("arm")

    def take_off(self, height_m: float) -> None:
        self.asked.append(height_m)

    def set_mode(self, mode: Mode) -> None:
        self.asked.append(mode)

    def land(self) -> None:
        raise PilotError("landing was denied")

    def mode(self) -> Mode:
        return Mode.HOLD

    def armed(self) -> bool:
        return True

    def is_flying(self) -> bool:
        return False


@pytest.mark.parametrize(
    "words",
    ["", "fly", "arm now", "takeoff high", "takeoff nan", "takeoff 0.1", "takeoff 1 2", "HOLD"],
)
def test_what_is_no_word_is_refused_with_what_was_expected(words: str) -> None:
    with pytest.raises(ConfigError, match=r"expected (arm, takeoff|0.5 to 20 m)"):
        parse(words.split() or [""])


def test_a_system_id_that_no_vehicle_has_is_refused(refused: Callable[..., str]) -> None:
    assert "--system-id is 999" in refused(main, "pilot", "--system-id", "999", "status")


def test_every_line_is_done_in_its_order_and_its_outcome_printed(
    capsys: pytest.CaptureFixture[str],
) -> None:
    pilot = ScriptedPilot()
    lines = ["takeoff 1.25\n", "\n", "hold\n", "quit\n", "arm\n"]
    execute_lines(cast(Pilot, pilot), lines, is_prompted=False)
    assert pilot.asked == ["prepare", 1.25, Mode.HOLD]
    assert capsys.readouterr().out.splitlines() == [
        "takeoff: HOLD, armed, on the ground",
        "hold: HOLD, armed, on the ground",
    ]


def test_a_prompt_goes_on_after_an_error(capsys: pytest.CaptureFixture[str]) -> None:
    pilot = ScriptedPilot()
    execute_lines(cast(Pilot, pilot), ["land\n", "jump\n", "hold\n"], is_prompted=True)
    assert pilot.asked == [Mode.HOLD]
    printed = capsys.readouterr().out
    assert "error: landing was denied" in printed
    assert "error: 'jump' is no word of the pilot" in printed


def test_words_from_a_file_end_at_the_first_error() -> None:
    pilot = ScriptedPilot()
    with pytest.raises(PilotError):
        execute_lines(cast(Pilot, pilot), ["land\n", "arm\n"], is_prompted=False)
    assert pilot.asked == []
