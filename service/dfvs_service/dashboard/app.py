"""Web application: static files, one WebSocket, and the threads behind them."""

import asyncio
import contextlib
import time
from collections.abc import AsyncIterator
from pathlib import Path

from starlette.applications import Starlette
from starlette.middleware import Middleware
from starlette.routing import Mount, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.websockets import WebSocket

from dfvs_common.clock import local_clock
from dfvs_service.dashboard.async_bridge import AsyncBridge
from dfvs_service.dashboard.client_session import AppContext, ClientSession
from dfvs_service.dashboard.command_queue import CommandQueue
from dfvs_service.dashboard.hub import Clock, Hub
from dfvs_service.dashboard.origin_check import OriginCheckMiddleware
from dfvs_service.dashboard.settings import DashboardSettings
from dfvs_service.dashboard.vehicles.clock import Moment
from dfvs_service.dashboard.vehicles.receiver import Receiver
from dfvs_service.dashboard.vehicles.sample import Arrival
from dfvs_service.dashboard.vehicles.vehicle_links import VehicleLinks
from dfvs_service.settings.sections import ZenohSection

PAGE = Path(__file__).parent / "page"
_TICK_S = 0.5


def present_moment() -> Moment:
    """Read both clocks."""
    return Moment(time.monotonic_ns(), time.time() * 1e3)


class Dashboard:
    """Everything behind the page."""

    def __init__(self, settings: DashboardSettings, clock: Clock = present_moment) -> None:
        self.address = settings.address
        self.hub = Hub(clock, self._watch, local_clock())
        self._clock = clock
        self._vehicle_links = VehicleLinks()
        key = settings.command_key
        command_queue = None if key is None else CommandQueue(key, self._vehicle_links.get)
        self.context = AppContext(self.hub, settings.tokens, command_queue, clock)
        self._links = settings.links
        self._receivers: list[Receiver] = []
        self._bridge: AsyncBridge | None = None

    async def run(self) -> None:
        """Receive and distribute until cancelled."""
        self._bridge = AsyncBridge(asyncio.get_running_loop(), self.hub.on_samples)
        self._receivers = [self._receiver(link, self._bridge) for link in self._links]
        for receiver in self._receivers:
            receiver.start()
        try:
            while True:
                await asyncio.sleep(_TICK_S)
                connected = sum(receiver.is_connected for receiver in self._receivers)
                zenoh = {"connected": connected, "links": len(self._receivers)}
                self.hub.tick({"zenoh": zenoh | {"warnings": self._vehicle_links.warnings()}})
        finally:
            for receiver in self._receivers:
                await asyncio.to_thread(receiver.close)
            self._bridge.close()

    def _receiver(self, link: ZenohSection, bridge: AsyncBridge) -> Receiver:
        def deliver(arrival: Arrival) -> None:
            if self._vehicle_links.admit(arrival.vehicle, link, self._clock().t_ns):
                bridge.deliver(arrival)

        return Receiver(link, deliver)

    def _watch(self, vehicles: frozenset[str]) -> None:
        for receiver in self._receivers:
            receiver.watch(vehicles)


def make_app(dashboard: Dashboard) -> Starlette:
    """Application to be served by an ASGI server."""

    @contextlib.asynccontextmanager
    async def lifespan(_app: Starlette) -> AsyncIterator[None]:
        running = asyncio.create_task(dashboard.run())
        yield
        running.cancel()
        await asyncio.gather(running, return_exceptions=True)

    async def visit(socket: WebSocket) -> None:
        await ClientSession(socket, dashboard.context).serve()

    return Starlette(
        routes=[WebSocketRoute("/live", visit), Mount("/", StaticFiles(directory=PAGE, html=True))],
        middleware=[Middleware(OriginCheckMiddleware, address=dashboard.address)],
        lifespan=lifespan,
    )
