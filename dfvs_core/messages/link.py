"""Messages between gate, perception and operator link: JSON in Unix datagrams.

Perception sends a ``PerceptionReport`` for every frame. The operator link sends commands and the
holders of leases. The gate sends its state to both, and answers to the operator link. A datagram
that does not follow the schema is dropped, never half-read.
"""

from dataclasses import dataclass
from typing import TypeVar

from dfvs_core.errors import WireError
from dfvs_core.messages.schema import from_json, to_json

T = TypeVar("T")

MAX_DATAGRAM_BYTES = 4096

MOUNTING_SCORE = 5.0
"""Standard deviations from which on the camera's mounting counts as right, or as wrong."""


@dataclass(frozen=True, slots=True)
class PerceptionReport:
    """What perception makes of one frame, or of the lack of one.

    ``velocity`` is (forward, right, down) in m/s and the yaw rate in rad/s, in the level body
    frame. ``healthy`` says that it may be flown; where it is false ``reason`` says why not, else
    which goal of a route is at hand, once the first was passed.
    ``reached`` says that the frame shows the goal within tolerance. ``lost`` says that the goal
    cannot be reached any more (wrong goal, no progress), which aborts. ``overlap`` is the share
    of the current view that shows the goal, 0 to 1. ``feature_error`` is the length of the flow to
    the goal in normalised units, of the same features from report to report and independent of
    depth. The gate's initial-response check uses it, and ``error_m`` and ``error_rad``.
    ``mounting_score`` is the test statistic of the camera's mounting
    (:mod:`dfvs_core.servo.checks.mounting`): clearly positive where it is as the settings say,
    clearly negative where not, None where nothing can be told.
    Before the first frame ``t_capture_ns`` is 0. ``goal`` is the digest of the goal that an
    operator commanded, empty while it is the one of the start. ``goals_left`` says how many goals
    of a route follow it: only the last one ends a flight.
    """

    seq: int
    t_capture_ns: int
    velocity: tuple[float, float, float, float]
    healthy: bool
    reached: bool
    lost: bool
    reason: str
    error_m: float
    error_rad: float
    overlap: float
    feature_error: float | None = None
    mounting_score: float | None = None
    goal: str = ""
    goals_left: int = 0


@dataclass(frozen=True, slots=True)
class VehicleState:
    """State of the vehicle by the autopilot, stamped with the time of its arrival.

    Angles in rad (world NED, body FRD), velocity NED in m/s, position NED in m relative to the
    autopilot's origin.
    """

    t_ns: int
    roll_rad: float
    pitch_rad: float
    yaw_rad: float
    velocity_m_s: tuple[float, float, float]
    position_m: tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class ForwardedCommand:
    """An operator's signed command, as it came from the network: only the gate can judge it."""

    payload: str


@dataclass(frozen=True, slots=True)
class CommandAnswer:
    """The gate's answer to a command; ``request`` is the command's ``request_id``."""

    request: str
    result: str


@dataclass(frozen=True, slots=True)
class ServiceFault:
    """Something outside the gate failed that the flight can do without; one line to show."""

    service_fault: str


@dataclass(frozen=True, slots=True)
class LeaseHolders:
    """Other services for the same vehicle, as the operator link sees them on the network."""

    standing_by: tuple[str, ...] = ()
    engaged: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class GateStatus:
    """The gate's state with its cause, and the vehicle's state (None before the first one).

    ``t_ns`` is the monotonic time of sending, ``since_ns`` that of entering the state. ``mode``,
    ``armed``, ``in_air`` and ``battery`` (0 to 1, None if unknown) are the autopilot's,
    ``heartbeat_age_s`` and ``battery_age_s`` say how old the newest of each is. ``setpoint`` is the
    velocity that was last sent: forward, right, down in m/s and yaw rate in rad/s; ``distance_m``
    says how far the vehicle is from where it was engaged. A signed command must carry
    ``challenge``; ``command_result`` says what became of the last one, ``command_count`` how many
    came. ``warnings`` are for the operator. ``goal`` is the digest of
    the goal that an operator commanded, empty while it is the one of the start.
    """

    state: str
    cause: str
    vehicle: VehicleState | None
    t_ns: int = 0
    reached: bool = False
    mode: str = ""
    armed: bool = False
    in_air: bool = False
    battery: float | None = None
    heartbeat_age_s: float | None = None
    setpoint: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    distance_m: float | None = None
    challenge: str = ""
    command_result: str = ""
    command_count: int = 0
    warnings: tuple[str, ...] = ()
    goal: str = ""
    since_ns: int = 0
    battery_age_s: float | None = None


ToGate = PerceptionReport | ForwardedCommand | LeaseHolders | ServiceFault
FromGate = GateStatus | CommandAnswer


def to_datagram(message: ToGate | FromGate) -> bytes:
    """Bytes of a message."""
    return to_json(message)


def from_datagram(cls: type[T], data: bytes) -> T:
    """Message of the given class from its bytes.

    Raises
    ------
    WireError
        If the bytes are too many, not JSON, or do not follow the schema (NaN included).
    """
    if len(data) > MAX_DATAGRAM_BYTES:
        raise WireError(f"datagram of {len(data)} bytes", f"at most {MAX_DATAGRAM_BYTES}")
    return from_json(cls, data)


def to_gate(data: bytes) -> ToGate:
    """Message to the gate from its bytes.

    Raises
    ------
    WireError
        If it is none of its kinds.
    """
    if data.startswith(b'{"payload"'):
        return from_datagram(ForwardedCommand, data)
    if data.startswith(b'{"standing_by"'):
        return from_datagram(LeaseHolders, data)
    if data.startswith(b'{"service_fault"'):
        return from_datagram(ServiceFault, data)
    return from_datagram(PerceptionReport, data)


def from_gate(data: bytes) -> FromGate:
    """Message of the gate from its bytes.

    Raises
    ------
    WireError
        If it is none of its kinds.
    """
    if data.startswith(b'{"request"'):
        return from_datagram(CommandAnswer, data)
    return from_datagram(GateStatus, data)
