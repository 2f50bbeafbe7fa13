"""Configuration of the gate: limits, times, engagement policy."""

import enum
from dataclasses import dataclass, field

from dfvs_core.gate.limits import VelocityLimits
from dfvs_core.messages.schema import setting

MS = 1_000_000
S = 1_000_000_000

NEVER = -(1 << 62)
"""Time of a message not received yet: older than any limit."""


class Engage(enum.StrEnum):
    """Who engages: the pilot's mode switch, the service itself, a signed command, or nobody."""

    PILOT = "pilot"
    AUTO = "auto"
    COMMAND = "command"
    NEVER = "never"
    """Watch and judge only: nothing is ever sent to move the vehicle."""


class OnDone(enum.StrEnum):
    """What follows when the goal is reached.

    Zero setpoints for ever, the autopilot's Hold, or going on to servo so that the vehicle stays
    although its own estimate drifts (for ``GateConfig.hold_visual_ns``, then Hold).
    """

    ZERO = "zero"
    HOLD = "hold"
    HOLD_VISUAL = "hold-visual"


@dataclass(frozen=True, slots=True)
class GateTiming:
    """Times in ns, after which the gate acts."""

    setpoint_gap_ns: int = 15 * MS
    """Setpoints never follow each other faster; the loop calls every 20 ms."""
    frame_age_ns: int = 250 * MS
    result_age_ns: int = 200 * MS
    clock_skew_ns: int = 5 * MS
    heartbeat_age_ns: int = 2 * S
    telemetry_age_ns: int = 500 * MS
    status_age_ns: int = 2 * S
    """Of what the autopilot sends less often: its estimator's flags, sensors, battery, landing."""
    parameters_age_ns: int = 30 * S
    """Failsafe parameters read longer ago may have been changed since."""
    estimate_doubt_ns: int = 5 * S
    """In the air the bit of the estimate in the health may be missing for so long on end."""
    services_age_ns: int = 5 * S
    """The operator link reports other services every second."""
    stall_ns: int = 150 * MS
    """A gate that was away for longer let the stream pause, and stops."""
    slew_step_ns: int = 100 * MS
    """Time that one setpoint's change of velocity may use up, however late it is."""
    ready_after_ns: int = 1 * S
    ready_grace_ns: int = 500 * MS
    engage_zero_ns: int = 1 * S
    confirm_ns: int = 2 * S
    good_data_ns: int = 1 * S
    hold_ns: int = 3 * S
    reached_ns: int = 1 * S
    response_ns: int = 1 * S
    """Least time at reduced speed; 0: no initial-response check."""
    response_limit_ns: int = 6 * S
    """Time at reduced speed after which a missing response ends the flight."""
    mode_known_ns: int = 1500 * MS
    """A heartbeat older than this says nothing about the mode any more."""
    link_silent_ns: int = 200 * MS
    """Without attitude and position for longer, a change of mode may not have been received; nor is
    it known from a message that comes sooner than this after the silence."""
    command_valid_ns: int = setting(
        5 * S, "age at which a command to engage expires, ns", formerly="order_valid_ns"
    )


@dataclass(frozen=True, slots=True)
class GateConfig:
    """Limits of invariant I1, times, thresholds, and how to engage and end."""

    velocity: VelocityLimits = field(default_factory=VelocityLimits)
    reduced_speed_m_s: float = 0.1
    """Largest linear speed until the initial-response check has passed."""
    max_distance_m: float = 5.0
    max_engaged_ns: int = 120 * S
    hold_visual_ns: int = 300 * S
    """Time for which the goal is held by vision, once reached."""
    min_overlap: float = 0.09
    min_frame_hz: float = 8.0
    """Fewer good frames a second refuse the preflight."""
    min_battery: float = 0.2
    max_jump_m: float = 0.5
    """Largest step of the position estimate beyond what the velocity explains."""
    engage: Engage = Engage.PILOT
    on_done: OnDone = OnDone.ZERO
    timing: GateTiming = field(default_factory=GateTiming)
