"""The numbers by which PX4's modes are known on the wire."""

import pytest

from dfvs_sim.vehicle.modes import Mode, mode_from_custom, mode_from_numbers


@pytest.mark.parametrize(
    ("mode", "main", "sub"),
    [
        (Mode.POSITION, 3, 0),
        (Mode.TAKEOFF, 4, 2),
        (Mode.HOLD, 4, 3),
        (Mode.RETURN, 4, 5),
        (Mode.LAND, 4, 6),
        (Mode.OFFBOARD, 6, 0),
    ],
)
def test_the_main_mode_is_in_the_third_byte_and_the_sub_mode_in_the_fourth(
    mode: Mode, main: int, sub: int
) -> None:
    assert mode.custom_mode == (main << 16 | sub << 24)


def test_base_mode_has_px4s_values() -> None:
    assert Mode.HOLD.base_mode(armed=False) == 29
    assert Mode.HOLD.base_mode(armed=True) == 29 + 128
    assert Mode.OFFBOARD.base_mode(armed=False) == 1
    assert Mode.OFFBOARD.base_mode(armed=True) == 145


@pytest.mark.parametrize("mode", list(Mode))
def test_every_mode_that_can_be_commanded_is_found_by_its_numbers(mode: Mode) -> None:
    found = mode_from_numbers(*mode.value)
    assert found is (None if mode is Mode.TERMINATION else mode)
    assert mode_from_custom(mode.custom_mode) is found


def test_numbers_that_mean_no_mode_give_none() -> None:
    assert mode_from_numbers(4, 99) is None
    assert mode_from_numbers(42, 0) is None
