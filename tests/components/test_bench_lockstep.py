"""``dfvs-bench lockstep``: what is printed and written of its flights."""

import json

import pytest

from dfvs_bench.cli import main
from dfvs_sim.options import write_json
from dfvs_sim.scene import builtin_room_path


def test_a_flight_that_is_never_released_has_no_start_in_the_json_and_the_line(tmp_path, capfd):
    out = tmp_path / "flights.json"
    words = ["--seeds", "3", "--timeout", "0.2", "--estimate", "high", "--speed", "0.4"]
    assert main(["lockstep", *words, "--json", str(out)]) == 0
    document = json.loads(out.read_text(), parse_constant=pytest.fail)
    (flight,), summary = document["flights"], document["summary"]
    assert (flight["start_m"], flight["end_s"], flight["end_state"]) == (None, None, "PREFLIGHT")
    assert (flight["seed"], flight["end_cause"]) == (3, "")
    assert (summary["done"], summary["other_ends"]) == (0, [])
    settings = document["settings"]
    assert (settings["matcher"], settings["depth"], settings["speed"]) == ("exact", "motion", 0.4)
    assert (settings["estimate"], settings["wind"]) == ("high", "calm")
    assert settings["scene"] == str(builtin_room_path())
    assert "seed 3: not released to servo, PREFLIGHT  (1 of 1)" in capfd.readouterr().err


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_a_number_that_json_lacks_is_not_written(tmp_path, value):
    with pytest.raises(ValueError, match="JSON"):
        write_json(tmp_path / "out.json", {"error_m": value})
    assert list(tmp_path.iterdir()) == []
