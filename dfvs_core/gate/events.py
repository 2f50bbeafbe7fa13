"""Input events and outputs of the gate; none of them arms or takes off."""

import enum
from dataclasses import dataclass

from dfvs_core.gate.limits import BodyVelocity
from dfvs_core.gate.states import Transition
from dfvs_core.messages.link import PerceptionReport


class VehicleMode(enum.StrEnum):
    """Flight modes of the autopilot, as far as the gate tells them apart."""

    OFFBOARD = "OFFBOARD"
    HOLD = "HOLD"
    POSITION = "POSITION"
    ALTITUDE = "ALTITUDE"
    MANUAL = "MANUAL"
    TAKEOFF = "TAKEOFF"
    LAND = "LAND"
    RETURN = "RETURN"
    MISSION = "MISSION"
    OTHER = "OTHER"


class Action(enum.StrEnum):
    """Actions of an operator's command."""

    ENGAGE = "engage"
    HOLD = "hold"
    ABORT = "abort"
    GOAL = "goal"
    """Fly to another goal from now on."""


@dataclass(frozen=True, slots=True)
class Heartbeat:
    """HEARTBEAT of the autopilot, once a second: by it alone the mode is known up to 1 s late."""

    t_ns: int
    mode: VehicleMode
    armed: bool
    failsafe: bool = False


@dataclass(frozen=True, slots=True)
class CurrentMode:
    """CURRENT_MODE of the autopilot, soon after each change of its mode (PX4 from 1.15 on)."""

    t_ns: int
    mode: VehicleMode


@dataclass(frozen=True, slots=True)
class Attitude:
    """Attitude of the body (FRD) in the world (NED), in rad."""

    t_ns: int
    roll_rad: float
    pitch_rad: float
    yaw_rad: float


@dataclass(frozen=True, slots=True)
class LocalPosition:
    """Position in m relative to the autopilot's origin and velocity in m/s, both NED."""

    t_ns: int
    position_m: tuple[float, float, float]
    velocity_m_s: tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class LandedState:
    """Whether the autopilot counts the vehicle as flying, or as standing on the ground."""

    t_ns: int
    in_air: bool
    on_ground: bool


@dataclass(frozen=True, slots=True)
class Battery:
    """Charge left, 0 to 1, or None where the autopilot does not know."""

    t_ns: int
    remaining: float | None


@dataclass(frozen=True, slots=True)
class Health:
    """Sensors of the autopilot; ``detail`` names what is not healthy.

    ``can_arm``: its checks before arming pass, which counts on the ground alone.
    ``only_estimate``: nothing is unhealthy but the attitude and position estimate.
    """

    t_ns: int
    ok: bool
    detail: str = ""
    can_arm: bool = True
    only_estimate: bool = False


@dataclass(frozen=True, slots=True)
class EstimatorState:
    """Whether attitude, velocity and position estimates are valid by the autopilot's flags.

    ``has_global_position``: PX4 flies Hold only with one.
    """

    t_ns: int
    valid: bool
    detail: str = ""
    has_global_position: bool = True


@dataclass(frozen=True, slots=True)
class ParametersRead:
    """The autopilot's failsafe parameters and speed limits were read, or could not be.

    ``refusals`` name what is dangerous or not known, ``advice`` what would better be changed, and
    ``found`` the values.
    """

    t_ns: int
    advice: tuple[str, ...] = ()
    refusals: tuple[str, ...] = ()
    found: str = ""


@dataclass(frozen=True, slots=True)
class VelocityTarget:
    """Velocity (NED, m/s) that the autopilot flies, where it flies a velocity and no position."""

    t_ns: int
    velocity_m_s: tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class ForeignSetpoint:
    """Somebody else's setpoint for this vehicle was received; ``detail`` says whose."""

    t_ns: int
    detail: str


@dataclass(frozen=True, slots=True)
class AmbiguousLink:
    """Several autopilots are on the link, and the settings name none; ``detail`` says which."""

    t_ns: int
    detail: str


@dataclass(frozen=True, slots=True)
class OtherServices:
    """Names of the other services that hold a lease on this vehicle's name at present."""

    t_ns: int
    standing_by: tuple[str, ...] = ()
    engaged: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class MonitorFailed:
    """The monitor of parameters and other commanders failed and was given up."""

    t_ns: int
    detail: str


@dataclass(frozen=True, slots=True)
class Report:
    """A report of perception arrived."""

    t_ns: int
    report: PerceptionReport


@dataclass(frozen=True, slots=True)
class BadReport:
    """Perception sent something that is not a report."""

    t_ns: int
    detail: str


@dataclass(frozen=True, slots=True)
class OperatorCommand:
    """An operator's command, found authentic; ``argument`` is the digest of a new goal."""

    t_ns: int
    action: Action
    argument: str = ""


@dataclass(frozen=True, slots=True)
class Stop:
    """The service is to end; ``unsupervised`` when the parent process fell silent."""

    t_ns: int
    detail: str
    unsupervised: bool = False


VehicleEvent = (
    Heartbeat
    | CurrentMode
    | Attitude
    | LocalPosition
    | LandedState
    | Battery
    | Health
    | EstimatorState
    | ParametersRead
    | VelocityTarget
    | ForeignSetpoint
    | AmbiguousLink
    | OtherServices
    | MonitorFailed
)
Event = VehicleEvent | Report | BadReport | OperatorCommand | Stop


class ModeRequest(enum.StrEnum):
    """The two modes that the gate may ask the autopilot for."""

    OFFBOARD = "OFFBOARD"
    HOLD = "HOLD"


@dataclass(frozen=True, slots=True)
class GateOutput:
    """What the gate wants sent and logged after one step.

    ``refusal`` says why an authentic command was refused, where there was one.
    """

    setpoint: BodyVelocity | None = None
    mode_request: ModeRequest | None = None
    transitions: tuple[Transition, ...] = ()
    refusal: str = ""
