"""Vehicle states from a MAVLink stream, without requests to the vehicle."""

import threading
import time
from collections import deque

from dfvs_core.gate.checks.preflight import SYSTEM_ID
from dfvs_core.gate.config import NEVER
from dfvs_core.gate.events import AmbiguousLink, Attitude, LocalPosition, VehicleEvent
from dfvs_core.gate.vehicle import VehicleMonitor
from dfvs_core.messages.link import VehicleState
from dfvs_service.gate.status import vehicle_state

_KEPT = 256


class VehicleStateListener:
    """Keeps the received states until they are requested.

    ``attitude_only``: take attitudes alone, as of a vehicle at rest; on a bench PX4 may have no
    position.
    """

    def __init__(self, *, attitude_only: bool = False) -> None:
        self._attitude_only = attitude_only
        self._lock = threading.Lock()
        self._vehicle = VehicleMonitor()
        self._ambiguity = ""
        if attitude_only:
            self._vehicle.update(LocalPosition(0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)))
        self._states: deque[VehicleState] = deque(maxlen=_KEPT)

    def connect(self, url: str, timeout_s: float, system_id: int) -> None:
        """Listen to an autopilot; blocks until it is received.

        ``timeout_s`` is the longest wait for a heartbeat; ``system_id`` 0 takes the only autopilot
        on the link.

        Raises
        ------
        VehicleError
            If the connection cannot be opened, none is received in time, or there are several.
        """
        # MAVSDK is needed here alone, and takes its time to load.
        from dfvs_service.gate.autopilot import LISTEN_S, Autopilot
        from dfvs_service.gate.mavlink_systems import VehicleError

        self._autopilot = Autopilot(self.on_event, lambda _kind, _text: None, system_id=system_id)
        self._autopilot.connect(url, timeout_s)
        if system_id == 0:
            time.sleep(LISTEN_S)
            self._autopilot.receive_from_others()
        if self._ambiguity:
            raise VehicleError(self._ambiguity, "one autopilot", SYSTEM_ID)

    def on_event(self, event: VehicleEvent) -> None:
        """Take an event, on any thread."""
        if isinstance(event, AmbiguousLink):
            self._ambiguity = event.detail
        if self._attitude_only and not isinstance(event, Attitude):
            return
        with self._lock:
            self._vehicle.update(event)
            state = vehicle_state(self._vehicle)
            if state is not None and (not self._states or state.t_ns > self._states[-1].t_ns):
                self._states.append(state)

    @property
    def on_ground(self) -> bool | None:
        """Whether the autopilot reports the vehicle on the ground; None until it is known."""
        landed = self._vehicle.landed
        return None if landed.t_ns == NEVER else landed.on_ground

    def new_states(self) -> list[VehicleState]:
        """States since the last call, oldest first."""
        with self._lock:
            states = list(self._states)
            self._states.clear()
            return states
