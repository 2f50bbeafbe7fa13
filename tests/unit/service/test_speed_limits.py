"""PX4's speed limits, which those of the gate must not be above."""

import math

import pytest

from dfvs_core.gate.limits import VelocityLimits
from dfvs_service.gate.failsafe import judge_failsafe
from dfvs_service.gate.speed_limits import SPEED_LIMITS, speed_refusals

DEFAULTS = {"MPC_XY_VEL_MAX": 12.0, "MPC_Z_VEL_MAX_UP": 3.0, "MPC_Z_VEL_MAX_DN": 1.5}


def refusals(limits=None, **values):
    return speed_refusals({**DEFAULTS, **values}, limits or VelocityLimits())


def test_the_limits_by_default_are_within_those_of_px4():
    assert set(SPEED_LIMITS) == set(DEFAULTS)
    assert refusals() == ()


@pytest.mark.parametrize(
    ("name", "setting", "limits"),
    [
        ("MPC_XY_VEL_MAX", "limits.horizontal_m_s", VelocityLimits(horizontal_m_s=0.9)),
        ("MPC_Z_VEL_MAX_UP", "limits.vertical_m_s", VelocityLimits(vertical_m_s=0.9)),
        ("MPC_Z_VEL_MAX_DN", "limits.vertical_m_s", VelocityLimits(vertical_m_s=0.9)),
    ],
)
def test_a_limit_above_that_of_px4_is_refused_with_both_numbers_and_both_remedies(
    name, setting, limits
):
    (line,) = refusals(limits, **{name: 0.7})
    assert line.startswith(f"{setting} is 0.9 m/s, above {name} 0.7 m/s")
    assert line.endswith("lower the setting, or raise the parameter")


def test_a_limit_that_is_that_of_px4_passes_though_it_travels_as_float32():
    limits = VelocityLimits(horizontal_m_s=0.7)
    assert refusals(limits, MPC_XY_VEL_MAX=0.699999988079071) == ()
    assert refusals(limits, MPC_XY_VEL_MAX=0.6999)


def test_a_parameter_that_this_px4_does_not_have_is_no_refusal():
    assert refusals(VelocityLimits(horizontal_m_s=5.0), MPC_XY_VEL_MAX=None) == ()
    assert speed_refusals({}, VelocityLimits()) == ()


def test_a_parameter_that_is_no_number_is_refused():
    assert refusals(MPC_XY_VEL_MAX=math.nan)


def test_they_are_refused_beside_the_failsafe():
    read = judge_failsafe(7, 1.0, 5, others=("too slow",))
    assert (read.refusals, read.advice, read.found) == (("too slow",), (), "")
    read = judge_failsafe(7, 0.5, 6, others=("too slow",))
    assert [line.split()[0] for line in read.refusals] == ["COM_OBL_RC_ACT", "too"]
