"""The stand-in pilot: what a person with a ground station and sticks would do.

Arms, takes off, switches modes and takes over. Each step is confirmed by the vehicle's heartbeat
or telemetry, because PX4's first acknowledgement proves nothing.
"""

import math
import time
from collections.abc import Callable

from pymavlink.dialects.v20 import development as mavlink

from dfvs_core.errors import DfvsError
from dfvs_sim.ground.link import ACCEPTED, GroundLink, Message
from dfvs_sim.ground.parameters import get_parameter, set_parameter
from dfvs_sim.ground.rest import WINDOW_S, RestDetector
from dfvs_sim.vehicle.modes import Mode, mode_from_custom

USUAL_HEIGHT_M = 1.5
"""Height to take off to, above where the vehicle stands."""
LEAST_HEIGHT_M, MOST_HEIGHT_M = 0.5, 20.0

_PREARM = 0x10000000
_ARMED = mavlink.MAV_MODE_FLAG_SAFETY_ARMED
_VEHICLE_S, _ARMABLE_S, _TAKE_OFF_S, _LANDING_S = 15.0, 60.0, 60.0, 120.0
_HEARTBEAT_S = 2.5
_TEXT_S = 0.1
_ARMING_PERIOD_S = 1.0
"""Longest time between two commands to arm."""
_LANDED_STATE_S = 2.5
_TEXTS_SHOWN = 3

ADVISED_PARAMETERS = {"COM_OF_LOSS_T": 0.5, "COM_OBL_RC_ACT": 5}
"""Offboard loss after half a second, and then Hold."""

ARMING_ADVICE = (
    "without a remote control or a ground station, COM_RC_IN_MODE 4, NAV_RCL_ACT 0 and "
    "NAV_DLL_ACT 0 may help"
)

_TEMPORARILY_REJECTED = 1
_RESULTS = {
    _TEMPORARILY_REJECTED: "temporarily rejected",
    2: "denied",
    3: "unsupported",
    4: "failed",
}


class PilotError(DfvsError):
    """The vehicle did not do what the pilot asked."""


class Pilot:
    """Flies the vehicle over the ground-station link, which it shares and does not own.

    ``log`` takes one line about what the pilot did and nobody asked for. It waits ``hover_s`` for
    rest; then it goes on with a vehicle that only seems to move a little, too. It asks again for
    ``arming_s`` while the vehicle refuses for the moment: its checks may flicker.
    """

    def __init__(
        self,
        link: GroundLink,
        log: Callable[[str], None] = lambda _: None,
        hover_s: float = 20.0,
        arming_s: float = 10.0,
    ) -> None:
        self._link = link
        self._log = log
        self._hover_s = hover_s
        self._arming_s = arming_s

    def prepare(self) -> None:
        """Wait until the vehicle can be armed, and set the advised parameters."""
        self.wait_until_armable()
        changed = []
        for name, value in ADVISED_PARAMETERS.items():
            old = get_parameter(self._link, name)
            if old != value:
                set_parameter(self._link, name, value)
                changed.append(f"{name} from {old:g} to {value:g}")
        if changed:
            self._log(f"the pilot changes {' and '.join(changed)}")

    def wait_until_armable(self) -> None:
        """Wait for the checks before arming, where the vehicle is not armed yet.

        Raises
        ------
        PilotError
            If they do not pass in time.
        """
        self._link.wait_for_vehicle(_VEHICLE_S)
        self._select_arming_mode()
        link = self._link
        if not self.armed() and link.wait_for("SYS_STATUS", _ARMABLE_S, _can_be_armed) is None:
            raise self._refused("the vehicle does not become ready to arm", remedy=ARMING_ADVICE)
        if self._link.wait_for("HOME_POSITION", _ARMABLE_S) is None:
            raise self._refused("the vehicle has no home position")

    def arm(self) -> None:
        """Arm in Hold; a refusal for the moment is asked again for ``arming_s``.

        Raises
        ------
        PilotError
            If the vehicle refuses.
        """
        self._select_arming_mode()
        command = mavlink.MAV_CMD_COMPONENT_ARM_DISARM
        deadline = time.monotonic() + self._arming_s
        while True:
            since_ns = time.monotonic_ns()
            result = self._link.command(command, 1.0)
            if result != _TEMPORARILY_REJECTED or time.monotonic() >= deadline:
                break
            self._link.wait_for("SYS_STATUS", _ARMING_PERIOD_S, _can_be_armed, since_ns)
        self._require_accepted("arming", result, since_ns, ARMING_ADVICE)
        self._confirm("arming", lambda m: bool(m.base_mode & _ARMED))

    def _select_arming_mode(self) -> None:
        """Select Hold before arming: other modes cannot be armed, or take off once armed."""
        if not self.armed() and self.mode() is not Mode.HOLD:
            self.set_mode(Mode.HOLD)

    def take_off(self, height_m: float) -> None:
        """Arm if need be, climb so far from here, and wait until at rest there.

        PX4's home may be that of an earlier flight, since when the estimate has wandered.

        Raises
        ------
        PilotError
            If the vehicle refuses or does not arrive.
        """
        if not self.armed():
            self.arm()
        home = self._link.wait_for("HOME_POSITION", _VEHICLE_S)
        if home is None:
            raise self._refused("the vehicle has no home position")
        place = self._link.wait_for("LOCAL_POSITION_NED", _VEHICLE_S)
        if place is None:
            raise self._refused("the vehicle does not tell its position")
        down_m = place.z - height_m
        altitude_m = home.altitude / 1000.0 + home.z - down_m
        self._command("take-off", mavlink.MAV_CMD_NAV_TAKEOFF, *[math.nan] * 6, altitude_m)
        top = place.z - 0.8 * height_m
        if self._link.wait_for("LOCAL_POSITION_NED", _TAKE_OFF_S, lambda m: m.z < top) is None:
            raise self._refused(f"the vehicle did not climb to {height_m:g} m")
        self._confirm("take-off", lambda m: _mode(m) is Mode.HOLD, _TAKE_OFF_S)
        self.wait_until_hovering(down_m)

    def wait_until_hovering(self, down_m: float | None = None) -> None:
        """Wait until the vehicle is at rest, at a local z where one is given.

        A vehicle whose estimate shows slow motion for the whole of ``hover_s`` passes too.

        Raises
        ------
        PilotError
            If it moves faster, or is at another height.
        """
        rest = RestDetector(down_m)
        deadline = time.monotonic() + self._hover_s
        since_ns = time.monotonic_ns()
        while time.monotonic() < deadline and not rest.is_at_rest:
            m = self._link.wait_for("LOCAL_POSITION_NED", 1.0, since_ns=since_ns)
            since_ns = time.monotonic_ns()
            if m is not None:
                rest.add(since_ns * 1e-9, (m.vx, m.vy, m.vz), m.z)
        if rest.is_at_rest:
            return
        if not rest.is_slow:
            raise self._refused("the vehicle does not come to rest")
        if not rest.is_at_height:
            side = "above" if rest.height_error_m > 0 else "below"
            raise self._refused(
                f"the vehicle is {abs(rest.height_error_m):.2f} m {side} the wanted height"
            )
        self._log(
            f"the vehicle's estimate does not come to rest ({rest.speed_m_s:.2f} m/s in the mean "
            f"of {WINDOW_S:g} s); the pilot goes on after {self._hover_s:g} s"
        )

    def set_mode(self, mode: Mode) -> None:
        """Switch the mode and wait for the heartbeat that shows it.

        Raises
        ------
        PilotError
            If the vehicle refuses or does not follow.
        """
        main, sub = mode.value
        what = f"switching to {mode.name}"
        self._command(what, mavlink.MAV_CMD_DO_SET_MODE, 1.0, float(main), float(sub))
        self._confirm(what, lambda m: _mode(m) is mode)

    def land(self) -> None:
        """Land and wait until the vehicle has disarmed itself.

        Raises
        ------
        PilotError
            If it does not in time.
        """
        self.set_mode(Mode.LAND)
        self._confirm("landing", lambda m: not m.base_mode & _ARMED, _LANDING_S)

    def mode(self) -> Mode | None:
        """Mode in the last heartbeat."""
        heartbeat = self._link.latest("HEARTBEAT")
        return None if heartbeat is None else _mode(heartbeat)

    def armed(self) -> bool:
        """Whether the last heartbeat shows the vehicle armed."""
        heartbeat = self._link.latest("HEARTBEAT")
        return heartbeat is not None and bool(heartbeat.base_mode & _ARMED)

    def is_flying(self) -> bool:
        """Whether the vehicle is in the air; whether it is armed, where it does not tell."""
        state = self._link.wait_for("EXTENDED_SYS_STATE", _LANDED_STATE_S)
        if state is None or state.landed_state == mavlink.MAV_LANDED_STATE_UNDEFINED:
            return self.armed()
        return bool(state.landed_state != mavlink.MAV_LANDED_STATE_ON_GROUND)

    def _command(self, what: str, command: int, *params: float) -> None:
        since_ns = time.monotonic_ns()
        self._require_accepted(what, self._link.command(command, *params), since_ns)

    def _require_accepted(self, what: str, result: int, since_ns: int, remedy: str = "") -> None:
        if result != ACCEPTED:
            raise self._refused(
                f"{what} was {_RESULTS.get(result, f'answered with {result}')}", since_ns, remedy
            )

    def _confirm(
        self, what: str, accept: Callable[[Message], bool], timeout_s: float = _HEARTBEAT_S
    ) -> None:
        since_ns = time.monotonic_ns()
        if self._link.wait_for("HEARTBEAT", timeout_s, accept, since_ns) is None:
            mode = self.mode()
            raise self._refused(
                f"{what} is not confirmed by a heartbeat within {timeout_s:g} s "
                f"(mode {mode.name if mode else 'unknown'})"
            )

    def _refused(self, problem: str, since_ns: int | None = None, remedy: str = "") -> PilotError:
        """Error with the vehicle's own words since then, which may trail the ack a little."""
        if since_ns is not None:
            self._link.wait_for("STATUSTEXT", _TEXT_S, since_ns=since_ns)
        said = [text for t_ns, text in self._link.texts if t_ns > (since_ns or 0)]
        quoted = ", ".join(f"'{text}'" for text in said[-_TEXTS_SHOWN:])
        words = [f"the vehicle says: {quoted}"] if quoted else []
        return PilotError(problem, remedy="; ".join([*words, *([remedy] if remedy else [])]))


def _can_be_armed(sys_status: Message) -> bool:
    return bool(sys_status.onboard_control_sensors_health & _PREARM)


def _mode(heartbeat: Message) -> Mode | None:
    return mode_from_custom(heartbeat.custom_mode)
