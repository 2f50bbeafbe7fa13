"""The autopilot's state that its parts share: mode, arming, landing, battery, home."""

from dataclasses import dataclass, field

from pymavlink.dialects.v20 import development as mavlink

from dfvs_sim.vehicle.modes import Mode

NS_PER_S = 1_000_000_000


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

    def landed_state(self) -> int:
        """MAV_LANDED_STATE in EXTENDED_SYS_STATE."""
        if self.landed:
            return int(mavlink.MAV_LANDED_STATE_ON_GROUND)
        in_air = mavlink.MAV_LANDED_STATE_IN_AIR
        states = {
            Mode.TAKEOFF: mavlink.MAV_LANDED_STATE_TAKEOFF,
            Mode.LAND: mavlink.MAV_LANDED_STATE_LANDING,
        }
        return int(states.get(self.mode, in_air))

    def system_status(self) -> int:
        """MAV_STATE in HEARTBEAT.system_status."""
        if self.mode is Mode.TERMINATION:
            return int(mavlink.MAV_STATE_FLIGHT_TERMINATION)
        if self.failsafe:
            return int(mavlink.MAV_STATE_CRITICAL)
        if self.armed:
            return int(mavlink.MAV_STATE_ACTIVE)
        return int(mavlink.MAV_STATE_STANDBY if self.can_arm else mavlink.MAV_STATE_UNINIT)
