"""A dashboard in this process whose clock stands still, and flights of any age on it."""

import asyncio
import dataclasses
import itertools
import threading
import time
from concurrent.futures import Future

import uvicorn
from loopback import free_tcp_port
from telemetry_vehicle import CLOCK, PICTURES, approach, approach_result, approach_status

from dfvs_core.messages.frame import Frame, PixelFormat, encode_frame
from dfvs_core.messages.schema import dump
from dfvs_service.dashboard.address import PublicAddress
from dfvs_service.dashboard.app import Dashboard, make_app
from dfvs_service.dashboard.settings import DashboardSettings
from dfvs_service.dashboard.tokens import Tokens
from dfvs_service.dashboard.vehicles.clock import Moment
from dfvs_service.dashboard.vehicles.sample import Arrival, Sample, unpack
from dfvs_service.perception.telemetry.images import TelemetryImages
from dfvs_service.perception.telemetry.messages import servo_document, timing_document
from dfvs_service.settings.config import load_config

S = 1_000_000_000
TOKEN = "operator-of-a-test" * 2
FLIGHT_S, STEP_S = 40, 0.2
ENGAGED_S, SERVO_S = 27.0, 25.0
"""Before the end: the times at which the gate entered ENGAGE and SERVO."""


@dataclasses.dataclass(frozen=True)
class Flight:
    """A flight that ends in ``state`` since ``since_s``; ``ages``: silence of sources, s.

    Its keys are state, vehicle, battery, results, view, flow and timing.
    """

    state: str = "SERVO"
    cause: str = "good data"
    since_s: float = 8.0
    ages: dict = dataclasses.field(default_factory=dict)
    fields: dict = dataclasses.field(default_factory=dict)
    knows_uncertainty: bool = True
    is_seen: bool = True
    """It has a camera and results; otherwise only a state."""

    def age(self, source):
        return self.ages.get(source, 0.0)

    def state_at(self, before_s):
        """State and cause so long before the end, and when it was entered."""
        for state, cause, entered_s in (
            (self.state, self.cause, self.since_s),
            ("SERVO", "good data", SERVO_S),
            ("ENGAGE", "pilot switched to OFFBOARD", ENGAGED_S),
        ):
            if before_s <= entered_s:
                return state, cause, entered_s
        return "READY", "checks passed", float(FLIGHT_S)

    @property
    def changes(self):
        """How many states were entered, one after the other."""
        steps = round(FLIGHT_S / STEP_S)
        states = [self.state_at(FLIGHT_S - step * STEP_S)[0] for step in range(steps + 1)]
        heard = states[: steps + 1 - round(self.age("state") / STEP_S)]
        return sum(1 for _ in itertools.groupby(heard))


class Screen:
    """Serves the dashboard; time passes only by ``moment``."""

    def __init__(self):
        self.t_ns, self.wall_ms = time.monotonic_ns(), time.time() * 1e3
        self.shift_ns = 0
        self.port = free_tcp_port()
        self.pictures = TelemetryImages(CLOCK, 0.3, 70, 1_000_000)
        self.start()

    @property
    def url(self):
        return f"http://127.0.0.1:{self.port}/"

    def moment(self):
        return Moment(self.t_ns + self.shift_ns, self.wall_ms + self.shift_ns * 1e-6)

    def start(self):
        address = PublicAddress.of(("127.0.0.1",), self.port, secure=False)
        tokens = Tokens(operator=TOKEN.encode(), is_open=True)
        settings = DashboardSettings(address, (), tokens, b"k" * 32)
        self.dashboard = Dashboard(settings, self.moment)
        config = uvicorn.Config(
            make_app(self.dashboard),
            port=self.port,
            ws="websockets-sansio",
            log_level="critical",
            timeout_graceful_shutdown=1,
        )
        self.server = uvicorn.Server(config)
        self.thread = threading.Thread(target=self.run)
        self.thread.start()
        while not self.server.started:
            time.sleep(0.01)

    def run(self):
        self.loop = asyncio.new_event_loop()
        self.loop.run_until_complete(self.server.serve())

    def stop(self):
        self.server.force_exit = self.server.should_exit = True
        self.thread.join()

    def show(self, name, flight):
        """Have a vehicle of that name fly until this moment; returns when it was taken in."""
        done = Future()

        def feed():
            for before_s, parcel in self.parcels(name, flight):
                self.shift_ns = -round(before_s * S)
                self.dashboard.hub.on_samples([parcel])
            self.shift_ns = 0
            self.dashboard.hub.tick({})
            done.set_result(None)

        self.loop.call_soon_threadsafe(feed)
        done.result(10.0)

    def parcels(self, name, flight):
        """Everything that the vehicle says: how long ago, and what."""
        goal, views, flows = approach()

        def is_last(source, before_s):
            return 0 <= round(before_s - flight.age(source), 3) < STEP_S

        start = self.pictures.goal(goal, self.t_ns - FLIGHT_S * S)
        yield FLIGHT_S, unpack(self.picture(name, "goal", start))
        yield FLIGHT_S, Sample(name, "config", dump(load_config(None, {})))
        for step in range(round(FLIGHT_S / STEP_S) + 1):
            before_s = FLIGHT_S - step * STEP_S
            t_ns = self.t_ns - round(before_s * S)
            left = min(max((before_s - 5) / (SERVO_S - 5), 0.4), 1.0)
            if before_s >= flight.age("state"):
                yield before_s, self.state(name, flight, t_ns, before_s, left)
            if not flight.is_seen:
                continue
            index = round((1 - left) * (PICTURES - 1))
            frame, flow = Frame(views[index], t_ns, step), flows[index]
            if before_s >= flight.age("results"):
                result = approach_result(frame, left, flow, 12.3, flight.knows_uncertainty)
                document = servo_document(frame, result, t_ns + 45_000_000, {})
                yield before_s, Sample(name, "servo", document)
            if before_s >= flight.age("timing") and step % 5 == 0:
                stages = {"match": {"p50_ms": 25.1, "p99_ms": 41.7, "max_ms": 50.0}}
                yield (
                    before_s,
                    Sample(name, "timing", timing_document(stages, t_ns, {"frames": step})),
                )
            if is_last("view", before_s):
                payload, attachment = encode_frame(frame, PixelFormat.JPEG, CLOCK)
                yield before_s, unpack(Arrival(name, "camera", payload, attachment))
            if is_last("flow", before_s):
                yield before_s, unpack(self.picture(name, "flow", self.pictures.flow(frame, flow)))

    @staticmethod
    def picture(name, stream, note):
        return Arrival(name, stream, note.payload, note.attachment or b"")

    def state(self, name, flight, t_ns, before_s, left):
        state, cause, entered_s = flight.state_at(before_s)
        late_s = max(flight.age("vehicle") - before_s, 0.0)
        moved_s = FLIGHT_S - before_s - late_s
        battery_s = max(flight.age("battery") - before_s, 0.0)
        status = approach_status(
            t_ns,
            moved_s,
            left,
            state=state,
            cause=cause,
            since_ns=self.t_ns - round(entered_s * S),
            challenge="c",
            heartbeat_age_s=0.4 + late_s,
            battery_age_s=0.6 + battery_s,
        )
        vehicle = dataclasses.replace(status.vehicle, t_ns=t_ns - round(late_s * S))
        fields = {"vehicle": vehicle} | flight.fields
        return Sample(name, "state", dump(dataclasses.replace(status, **fields)))
