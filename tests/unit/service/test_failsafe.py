from typing import ClassVar

import pytest
from mavsdk import MavsdkError

from dfvs_core.gate.limits import VelocityLimits
from dfvs_service.gate.autopilot import Autopilot
from dfvs_service.gate.failsafe import judge_failsafe


def test_the_advised_failsafe_passes_without_a_word():
    read = judge_failsafe(7, 0.5, 5)
    assert (read.t_ns, read.advice, read.refusals) == (7, (), ())
    assert read.found == "COM_OF_LOSS_T 0.5, COM_OBL_RC_ACT 5"


@pytest.mark.parametrize(
    ("loss_s", "action", "advice"),
    [(1.0, 5, "COM_OF_LOSS_T is 1; 0.5 is advised"), (0.5, 4, "COM_OBL_RC_ACT is 4 (land)")],
)
def test_what_is_merely_not_advised_is_said_and_refuses_nothing(loss_s, action, advice):
    read = judge_failsafe(0, loss_s, action)
    assert read.refusals == ()
    (line,) = read.advice
    assert line.startswith(advice)


@pytest.mark.parametrize(
    ("action", "meaning"),
    [
        (0, "0 (position, without a radio return)"),
        (1, "1 (altitude, without a radio return)"),
        (2, "2 (stabilised, without a radio return)"),
        (3, "3 (return)"),
    ],
)
def test_a_return_to_launch_where_setpoints_stop_is_refused_unless_it_is_allowed(action, meaning):
    """PX4 flies the modes that need sticks as return-to-launch where no radio is heard."""
    refused = judge_failsafe(0, 0.5, action)
    (line,) = refused.refusals
    assert meaning in line
    assert "gate.allow_return = true" in line
    assert "set 5 (hold)" in line
    allowed = judge_failsafe(0, 0.5, action, allow_return=True)
    assert allowed.refusals == ()
    (line,) = allowed.advice
    assert meaning in line
    assert "return to launch" in line
    assert allowed.found == f"COM_OF_LOSS_T 0.5, COM_OBL_RC_ACT {action}"


@pytest.mark.parametrize("action", [6, 7, 99])
def test_what_lets_the_vehicle_fall_is_refused_though_a_return_is_allowed(action):
    assert judge_failsafe(0, 0.5, action, allow_return=True).refusals


@pytest.mark.parametrize(
    ("loss_s", "action", "refusal"),
    [
        (1.001, 5, "COM_OF_LOSS_T is 1.001 s"),
        (60.0, 5, "fly on blindly"),
        (0.0, 5, "COM_OF_LOSS_T is 0 s"),
        (float("nan"), 5, "COM_OF_LOSS_T is nan s"),
        (None, 5, "COM_OF_LOSS_T could not be read"),
        (0.5, None, "COM_OBL_RC_ACT could not be read"),
        (0.5, 6, "COM_OBL_RC_ACT is 6 (terminate)"),
        (0.5, 7, "COM_OBL_RC_ACT is 7 (disarm)"),
        (0.5, 99, "COM_OBL_RC_ACT is 99 (not known)"),
    ],
)
def test_what_is_dangerous_or_not_known_is_refused(loss_s, action, refusal):
    (line,) = judge_failsafe(0, loss_s, action).refusals
    assert refusal in line


class Parameters:
    """An autopilot that answers as long as it is told to, and has some speed limits."""

    answers = True
    speeds: ClassVar = {"MPC_XY_VEL_MAX": 12.0}

    def get_param_float(self, name):
        if name.startswith("MPC_") and name not in self.speeds:
            raise MavsdkError("timeout")
        return self._read(self.speeds.get(name, 0.5))

    def get_param_int(self, _):
        return self._read(5)

    def _read(self, value):
        if not self.answers:
            raise MavsdkError("timeout")
        return value


def test_a_reading_without_an_answer_says_nothing_once_the_parameters_are_known():
    """The age of the last reading is what the gate judges by."""
    read = []
    autopilot = Autopilot(read.append, lambda *_: None)
    autopilot._param = Parameters()
    autopilot._param.answers = False
    assert not autopilot._read_parameters()
    assert read.pop().refusals
    autopilot._param.answers = True
    assert autopilot._read_parameters()
    assert not read.pop().refusals
    autopilot._param.answers = False
    assert not autopilot._read_parameters()
    assert read == []


def test_speed_limits_are_read_with_the_failsafe_and_those_that_are_missing_pass():
    read = []
    autopilot = Autopilot(read.append, lambda *_: None, limits=VelocityLimits(horizontal_m_s=2.0))
    autopilot._param = Parameters()
    assert autopilot._read_parameters()
    assert not read.pop().refusals
    autopilot._param.speeds = {"MPC_XY_VEL_MAX": 1.0}
    assert autopilot._read_parameters()
    (line,) = read.pop().refusals
    assert "limits.horizontal_m_s is 2 m/s, above MPC_XY_VEL_MAX 1 m/s" in line
