"""The autopilot's state that its parts share: mode, arming, landing, battery, home."""

import enum
from dataclasses import dataclass, field

from dfvs_sim.vehicle.modes import Mode

NS_PER_S = 1_000_000_000


class Landed(enum.IntEnum):
    """MAV_LANDED_STATE."""

    ON_GROUND = 1
    IN_AIR = 2
    TAKEOFF = 3
    LANDING = 4


class SystemStatus(enum.IntEnum):
    """MAV_STATE, the ones that PX4 shows."""

    UNINIT = 0
    STANDBY = 3
    ACTIVE = 4
    CRITICAL = 5
    FLIGHT_TERMINATION = 8


@dataclass(slots=True)
class Status:
    """Mutable heart of the autopilot.

    ``intended`` is the mode that was asked for last; ``mode`` is the one that is flown and shown,
    another one only while a failsafe acts. Disarming selects ``after_disarming``, the last mode
    asked for that can be armed. Times are monotonic ns.
    """

    boot_ns: int
    published_ns: int = 0
    """When the autopilot's parts were told of it last: at each change, and twice a second."""
    ready: bool = False
    can_arm: bool = False
    """Whether it could be armed in the mode asked for; checked ten times a second."""
    intended: Mode = Mode.HOLD
    mode: Mode = Mode.HOLD
    after_disarming: Mode = Mode.HOLD
    failsafe: bool = False
    armed: bool = False
    armed_ns: int = 0
    landed: bool = True
    landed_ns: int = 0
    flew: bool = False
    home_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    battery: float = 1.0
    estimator_ok: bool = True
    warns_of_estimate: bool = False
    """The arming check warns of the estimate, as of a large accelerometer bias."""
    setpoint_ns: int | None = None
    """When the last valid offboard setpoint came."""
    manual_ns: int | None = None
    """When the pilot's last MANUAL_CONTROL came."""
    texts: list[str] = field(default_factory=list)

    def landed_state(self) -> Landed:
        """EXTENDED_SYS_STATE.landed_state."""
        if self.landed:
            return Landed.ON_GROUND
        if self.mode is Mode.TAKEOFF:
            return Landed.TAKEOFF
        return Landed.LANDING if self.mode is Mode.LAND else Landed.IN_AIR

    def system_status(self) -> SystemStatus:
        """HEARTBEAT.system_status."""
        if self.mode is Mode.TERMINATION:
            return SystemStatus.FLIGHT_TERMINATION
        if self.failsafe:
            return SystemStatus.CRITICAL
        if self.armed:
            return SystemStatus.ACTIVE
        return SystemStatus.STANDBY if self.can_arm else SystemStatus.UNINIT
