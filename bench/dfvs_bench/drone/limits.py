"""The settings that a service flies by, asked of the service itself."""

import math
import subprocess
import sys
import tomllib
from collections.abc import Mapping, Sequence
from typing import Any

from dfvs_core.errors import ConfigError
from dfvs_core.gate.limits import VelocityLimits
from dfvs_core.servo.config import BY_NETWORK

_TIMEOUT_S = 60.0


def settings_in_force(words: Sequence[str]) -> dict[str, Any]:
    """All settings of a service with these ``--set`` and ``--config`` words, by section and key.

    Raises
    ------
    ConfigError
        If the service refuses them, or does not answer.
    """
    command = [sys.executable, "-m", "dfvs_service.cli", "config", *words]
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, check=False, timeout=_TIMEOUT_S
        )
    except subprocess.TimeoutExpired as error:
        raise ConfigError(
            f"dfvs-service config gave no answer in {_TIMEOUT_S:g} s", "an idle machine"
        ) from error
    if done.returncode != 0:
        said = done.stderr.strip().splitlines()[-1:] or ["nothing"]
        raise ConfigError(f"dfvs-service refuses its settings: {said[0].removeprefix('error: ')}")
    return tomllib.loads(done.stdout)


def depth_network(settings: Mapping[str, Any]) -> str | None:
    """Bundle of the depth network that perception needs with these settings, if any."""
    return settings["depth"]["model"] if settings["servo"]["depth"] in BY_NETWORK else None


def velocity_limits(settings: Mapping[str, Any]) -> VelocityLimits:
    """Limits with these settings: the lower of the servo law's and the gate's.

    The reduced speed of the first moments (``gate.reduced_speed_m_s``) is not among them.
    """
    servo, gate = settings["servo"], settings["limits"]
    return VelocityLimits(
        horizontal_m_s=min(servo["max_horizontal_m_s"], gate["horizontal_m_s"]),
        vertical_m_s=min(servo["max_vertical_m_s"], gate["vertical_m_s"]),
        yaw_rad_s=math.radians(min(servo["max_turn_deg_s"], gate["yaw_deg_s"])),
        slew_m_s2=gate["slew_m_s2"],
        yaw_slew_rad_s2=math.radians(gate["yaw_slew_deg_s2"]),
    )
