"""One ground-station link to the vehicle, shared by everybody in the process.

A single thread owns the socket: it receives, keeps the newest message of each type, calls the
subscribers and sends the ground station's heartbeat. Everything else may be called from any
thread; callbacks run on the link's thread and must be short.
"""

import contextlib
import select
import socket
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable
from typing import Any, NamedTuple, Self

from pymavlink.dialects.v20 import development as mavlink

from dfvs_common.status_text import plain_text
from dfvs_sim.ground.systems import HEARTBEATS_S, Autopilots, LinkError
from dfvs_sim.ground.udp import Endpoint

DEFAULT_URL = "udpin://127.0.0.1:14550"

ACCEPTED, IN_PROGRESS = 0, 5
"""MAV_RESULT."""

_HEARTBEAT_S = 1.0
_SECOND_ACK_S = 0.1
_RETRIES = 3
_TEXTS = 20
"""Kept of the vehicle's last ones."""
_HEARTBEAT = mavlink.MAVLink_heartbeat_message(
    mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, mavlink.MAV_STATE_ACTIVE, 3
)
_NUMBERS = {kind.msgname: kind.id for kind in mavlink.mavlink_map.values()}

Message = Any
Callback = Callable[[Message, int], None]


class _Received(NamedTuple):
    message: Message
    t_ns: int


class _Text(NamedTuple):
    t_ns: int
    number: int
    raw: str


class StatusTexts:
    """Last STATUSTEXTs, chunks of a long text joined."""

    def __init__(self) -> None:
        self._texts: deque[_Text] = deque(maxlen=_TEXTS)

    def add(self, message: Any, t_ns: int) -> None:
        """Take a STATUSTEXT that arrived at a monotonic time."""
        last = self._texts[-1] if self._texts else None
        if last is not None and message.chunk_seq > 0 and message.id == last.number != 0:
            self._texts[-1] = _Text(last.t_ns, last.number, last.raw + message.text)
        else:
            self._texts.append(_Text(t_ns, message.id, message.text))

    @property
    def all(self) -> tuple[tuple[int, str], ...]:
        """Texts with their arrival (monotonic ns), oldest first."""
        return tuple((text.t_ns, plain_text(text.raw.partition("\0")[0])) for text in self._texts)


class GroundLink:
    """MAVLink to one vehicle over UDP, as a ground station.

    ``udpin://HOST:PORT`` is found by the vehicle, ``udpout://HOST:PORT`` finds it. ``system_id`` is
    that of the vehicle; None takes the only one on the link.
    """

    def __init__(self, url: str = DEFAULT_URL, system_id: int | None = None) -> None:
        endpoint = Endpoint.from_url(url)
        self.url = url
        self._socket = endpoint.open()
        self._socket.setblocking(False)
        self._remote = None if endpoint.listens else (endpoint.host, endpoint.port)
        self._wake, self._woken = socket.socketpair()
        self._packer = mavlink.MAVLink(None, 255, mavlink.MAV_COMP_ID_MISSIONPLANNER)
        self._parser = mavlink.MAVLink(None)
        self._parser.robust_parsing = True
        self._changed = threading.Condition(threading.RLock())
        self._latest: dict[str, _Received] = {}
        self._subscribers: list[tuple[frozenset[str], Callback]] = []
        self._texts = StatusTexts()
        self._autopilots = Autopilots(system_id)
        self._closing = False
        self._thread = threading.Thread(target=self._run, name="ground-link", daemon=True)
        self._thread.start()

    def __enter__(self) -> Self:
        """Return the running link."""
        return self

    def __exit__(self, *_: object) -> None:
        """Stop the thread and give the port back."""
        self._closing = True
        self._wake.send(b"x")
        self._thread.join()
        for sock in (self._socket, self._wake, self._woken):
            sock.close()

    @property
    def port(self) -> int:
        """UDP port of our side."""
        return int(self._socket.getsockname()[1])

    @property
    def texts(self) -> tuple[tuple[int, str], ...]:
        """The vehicle's last texts with their arrival (monotonic ns), oldest first."""
        with self._changed:
            return self._texts.all

    def subscribe(self, names: Iterable[str], callback: Callback) -> Callable[[], None]:
        """Have ``callback(message, t_ns)`` called for these types; returns what ends that."""
        entry = (frozenset(names), callback)
        with self._changed:
            self._subscribers = [*self._subscribers, entry]

        def end() -> None:
            with self._changed:
                self._subscribers = [e for e in self._subscribers if e is not entry]

        return end

    def latest(self, name: str) -> Message | None:
        """Newest message of the type; None before the first."""
        with self._changed:
            received = self._latest.get(name)
            return None if received is None else received.message

    def wait_for(
        self,
        name: str,
        timeout_s: float,
        accept: Callable[[Message], bool] = lambda _: True,
        since_ns: int = 0,
    ) -> Message | None:
        """Wait for a message of the type that arrived after since_ns; None on timeout.

        Only the newest message is looked at: use ``subscribe`` where none may be missed.
        """

        def good() -> bool:
            received = self._latest.get(name)
            return received is not None and received.t_ns > since_ns and accept(received.message)

        with self._changed:
            found = self._changed.wait_for(good, timeout_s)
            return self._latest[name].message if found else None

    def wait_for_vehicle(self, timeout_s: float) -> None:
        """Wait for the vehicle's heartbeat, and for those of others where no id tells ours.

        Its mode and whether it is armed are known from then on.

        Raises
        ------
        LinkError
            If it does not come within the timeout, or if several vehicles could be ours.
        """
        autopilots = self._autopilots
        with self._changed:
            if not self._changed.wait_for(lambda: "HEARTBEAT" in self._latest, timeout_s):
                raise autopilots.silence_error(self.url, timeout_s)
            if autopilots.wanted is None:
                listened_s = (time.monotonic_ns() - autopilots.chosen_ns) * 1e-9
                left_s = HEARTBEATS_S - listened_s
                if left_s > 0 and self._changed.wait_for(lambda: bool(autopilots.others), left_s):
                    raise autopilots.ambiguity_error(self.url)

    @property
    def target(self) -> int:
        """System id of the vehicle, 0 before its first heartbeat."""
        return self._autopilots.chosen or 0

    def send(self, message: Message) -> None:
        """Send one message; lost where no vehicle has sent yet, as on a radio."""
        with self._changed:
            self.send_bytes(message.pack(self._packer))

    def send_bytes(self, data: bytes) -> None:
        """Send messages that are packed already, such as another ground station's."""
        with self._changed:
            if self._remote is not None:
                with contextlib.suppress(OSError):  # also without a network, which may come back
                    self._socket.sendto(data, self._remote)

    def command(self, command: int, *params: float, timeout_s: float = 1.0) -> int:
        """Send COMMAND_LONG, again if unanswered, and give the final ack's MAV_RESULT.

        PX4 acknowledges DO_SET_MODE twice, at once and with the true result: the last one counts.

        Raises
        ------
        LinkError
            If no ack comes.
        """
        padded = [*params, *[0.0] * (7 - len(params))]
        acks: list[int] = []

        def keep(message: Message, _: int) -> None:
            if message.command == command:
                with self._changed:
                    acks.append(message.result)

        end = self.subscribe(["COMMAND_ACK"], keep)
        try:
            for attempt in range(_RETRIES):
                self.send(
                    mavlink.MAVLink_command_long_message(self.target, 1, command, attempt, *padded)
                )
                if self._await_final(acks, command, timeout_s):
                    return acks[-1]
        finally:
            end()
        raise LinkError(f"the vehicle did not answer command {command}", "an acknowledgement")

    def request_stream(self, name: str, rate_hz: float) -> int:
        """Ask for a message at a rate; returns the MAV_RESULT."""
        interval_us = round(1e6 / rate_hz)
        return self.command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, _NUMBERS[name], interval_us)

    def _await_final(self, acks: list[int], command: int, timeout_s: float) -> bool:
        with self._changed:
            if not self._changed.wait_for(lambda: any(a != IN_PROGRESS for a in acks), timeout_s):
                return False
            if command == mavlink.MAV_CMD_DO_SET_MODE:
                self._changed.wait_for(lambda: len(acks) > 1, _SECOND_ACK_S)
            return True

    def _run(self) -> None:
        """Receive, call and send until closed."""
        next_s = 0.0
        while not self._closing:
            wait_s = max(0.0, next_s - time.monotonic())
            select.select([self._socket, self._woken], [], [], wait_s)
            self._receive()
            now_s = time.monotonic()
            if now_s >= next_s:
                next_s = max(next_s + _HEARTBEAT_S, now_s)
                self._send_heartbeat()

    def _receive(self) -> None:
        for sock in (self._woken, self._socket):
            while not self._closing:
                try:
                    data, sender = sock.recvfrom(65535, socket.MSG_DONTWAIT)
                except BlockingIOError:
                    break
                if sock is self._socket:
                    self._on_datagram(data, sender)

    def _on_datagram(self, data: bytes, sender: tuple[str, int]) -> None:
        t_ns = time.monotonic_ns()
        for message in self._parser.parse_buffer(data) or ():
            name = message.get_type()
            if name == "BAD_DATA" or not self._is_from_vehicle(message, sender, t_ns):
                continue
            with self._changed:
                self._latest[name] = _Received(message, t_ns)
                if name == "STATUSTEXT":
                    self._texts.add(message, t_ns)
                subscribers = self._subscribers
            for names, callback in subscribers:
                if name in names:
                    callback(message, t_ns)
            with self._changed:
                self._changed.notify_all()

    def _is_from_vehicle(self, message: Message, sender: tuple[str, int], t_ns: int) -> bool:
        """Whether our vehicle's autopilot sent it."""
        with self._changed:
            is_found = self._autopilots.update(message, t_ns)
            is_ours = self._autopilots.is_ours(message)
            if is_ours and message.get_type() == "HEARTBEAT":
                self._remote = sender  # a vehicle that was started again may have another port
            self._changed.notify_all()
        if is_found:
            self._send_heartbeat()
        return is_ours

    def _send_heartbeat(self) -> None:
        self.send(_HEARTBEAT)
