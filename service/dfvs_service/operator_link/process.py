"""Operator link process: Zenoh's listening end, state, answers, commands and name leases.

It does no work that takes time: the state leaves at its rate and commands reach the gate while
perception is busy, hangs, or is gone. Without a router it owns the service's endpoints, and
perception connects to it over a Unix socket.
"""

import contextlib
import logging
import queue
import time
from types import FrameType

import zenoh

from dfvs_common.progress import warn
from dfvs_core.gate.config import Engage
from dfvs_core.messages.link import CommandAnswer, ForwardedCommand, FromGate
from dfvs_core.messages.schema import dump, to_json
from dfvs_core.messages.topics import Topics
from dfvs_service.flight_feed import FlightFeed
from dfvs_service.gate_link import GateLink
from dfvs_service.goal_store import GoalStore
from dfvs_service.operator_link.command_filter import CommandFilter
from dfvs_service.operator_link.name_lease import NameLease
from dfvs_service.pace import Pace, StatePace
from dfvs_service.settings.config import ServiceConfig
from dfvs_service.settings.runtime import RuntimeFolder
from dfvs_service.telemetry import Telemetry
from dfvs_service.zenoh_session import attachment_of, link_zenoh, open_persistently, open_session

_TURN_S = 0.05
_MAX_ANSWERS = 64

log = logging.getLogger("dfvs.operator_link")


class OperatorLink:
    """Publishes the gate's state, and forwards operators' commands to it."""

    def __init__(self, config: ServiceConfig, runtime: RuntimeFolder) -> None:
        self._config = config
        self._runtime = runtime
        self._topics = Topics(config.vehicle.name)
        self._pace = StatePace(Pace.of_rate(config.telemetry.state_hz))
        self._filter = CommandFilter(GoalStore(runtime.new_goals), time.monotonic_ns())
        self._telemetry: Telemetry | None = None
        self._answers: queue.Queue[CommandAnswer] = queue.Queue(_MAX_ANSWERS)
        self._state = ""
        self._gate = GateLink(runtime.gate_socket, runtime.link_socket, self._on_gate)
        self._flight_feed = FlightFeed(runtime.black_box_socket)
        self._stopped = False

    def run(self) -> None:
        """Work until told to stop.

        Raises
        ------
        ConfigError
            If Zenoh cannot be opened.
        """
        session = self._open()
        if session is not None:
            with session:
                self._serve(session)
        self._flight_feed.close()
        self._gate.close()

    def stop(self, _signal: int, _frame: FrameType | None) -> None:
        """Signal handler: end."""
        self._stopped = True

    def _open(self) -> zenoh.Session | None:
        """Open Zenoh's listening end, or wait for the router; None if stopped before."""
        section = link_zenoh(self._config.zenoh, self._runtime)
        if section.mode == "client":
            return open_persistently(section, lambda: self._stopped, warn)
        return open_session(section, (self._config.vehicle.name,))

    def _serve(self, session: zenoh.Session) -> None:
        """Publish and forward until told to stop."""
        self._telemetry = Telemetry(session, self._topics, self._gate.report, self._flight_feed.put)
        answers = session.declare_publisher(
            self._topics.telemetry("answer"),
            congestion_control=zenoh.CongestionControl.DROP,
            priority=zenoh.Priority.INTERACTIVE_HIGH,
            express=True,
        )
        commands = session.declare_subscriber(self._topics.command, self._on_command)
        goals = session.declare_subscriber(self._topics.new_goal, self._on_goal)
        watches = self._config.gate.engage is Engage.NEVER
        name_lease = NameLease(session, self._topics, self._gate.send, watches=watches)
        while not self._stopped:
            self._publish_answer(answers)
            name_lease.show(self._state)
            name_lease.notify()
        name_lease.close()
        del commands, goals
        self._telemetry.close()

    def _on_gate(self, message: FromGate) -> None:
        """Thread of the gate's datagrams: offer states as they are due, and every answer."""
        if isinstance(message, CommandAnswer):
            with contextlib.suppress(queue.Full):
                self._answers.put_nowait(message)
            return
        self._state = message.state
        if self._telemetry is None:
            return
        if self._pace.due(message.state, time.monotonic_ns()):
            self._telemetry.offer_json("state", dump(message))

    def _publish_answer(self, publisher: zenoh.Publisher) -> None:
        """Publish the next answer, waiting for one at most so long."""
        with contextlib.suppress(queue.Empty):
            answer = self._answers.get(timeout=_TURN_S)
            try:
                publisher.put(to_json(answer), encoding="application/json")
            except zenoh.ZError as error:
                log.warning("answer not published: %s", error)

    def _on_command(self, sample: zenoh.Sample) -> None:
        """Zenoh's thread: pass an operator's command on; the gate judges it."""
        payload = sample.payload.to_bytes()
        self._forward(self._filter.receive_command(payload, time.monotonic_ns()))

    def _on_goal(self, sample: zenoh.Sample) -> None:
        """Zenoh's thread: keep a new goal unopened, and let the gate judge its command."""
        payload, signed = sample.payload.to_bytes(), attachment_of(sample)
        self._forward(self._filter.receive_goal(payload, signed, time.monotonic_ns()))

    def _forward(self, command: ForwardedCommand | None) -> None:
        if command is not None:
            self._gate.send(command)
