"""Client session of one browser: authentication, subscription and commands."""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging
import struct
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import Any

from starlette.websockets import WebSocket, WebSocketDisconnect

from dfvs_core.messages.goal_command import MAX_SIDECAR_BYTES, GoalCommand
from dfvs_core.messages.link import MOUNTING_SCORE
from dfvs_core.messages.zenoh_settings import MAX_MESSAGE_BYTES
from dfvs_service.dashboard.command_queue import STOPS, CommandQueue
from dfvs_service.dashboard.hub import Clock, Hub
from dfvs_service.dashboard.outbox import Outbox
from dfvs_service.dashboard.tokens import Role, Tokens
from dfvs_service.dashboard.vehicles.clock import Moment
from dfvs_service.dashboard.vehicles.vehicle_model import PATH_COLUMNS, SERVO_COLUMNS

MAX_BROWSERS = 32
MAX_UNKNOWN = 8
"""Connections at a time that have not shown who they are: each may send one whole message."""
MAX_HELLO_BYTES = 4096
HELLO_TIMEOUT_S = 5.0
WRONG_TOKEN_DELAY_S = 1.0
MAX_PENDING_COMMANDS = 2
"""Unanswered commands of a page; a Hold or an Abort waits only for its own kind and vehicle."""
MAX_PENDING_STOPS = 16
"""Unanswered commands of a page with which even a Hold or an Abort is refused."""

_STOP_THREADS = 16

CLOSE_DENIED = 4401
"""The token gives no access: the page forgets it, and does not connect again by itself."""
CLOSE_TOO_SLOW = 4408
CLOSE_FULL = 4429
CLOSE_UNREADABLE = 1003
CLOSE_TOO_LARGE = 1009

log = logging.getLogger("dfvs.dashboard")
_LENGTH = struct.Struct("<I")
_MAX_HEADER_BYTES = 2 * MAX_SIDECAR_BYTES
_IMAGE = "image"


@dataclass(frozen=True, slots=True)
class AppContext:
    """State shared by all client sessions; ``command_queue`` is None where none can be sent."""

    hub: Hub
    tokens: Tokens
    command_queue: CommandQueue | None
    clock: Clock
    unknown: set[ClientSession] = field(default_factory=set)
    """Sessions that have not shown who they are."""
    stop_threads: ThreadPoolExecutor = field(
        default_factory=lambda: ThreadPoolExecutor(_STOP_THREADS, "dashboard-stop")
    )
    """Where Hold and Abort wait for their answers, so that other commands do not hold them up."""


class ClientSession:
    """Serves one WebSocket until it closes."""

    def __init__(self, socket: WebSocket, context: AppContext) -> None:
        self._socket = socket
        self._context = context
        self._outbox = Outbox()
        self._role = Role.NOBODY
        self._pending: dict[asyncio.Task[None], tuple[str, str]] = {}
        """Action and vehicle of every command that is not answered yet."""

    async def serve(self) -> None:
        """Greet, then send and receive at the same time."""
        with contextlib.suppress(WebSocketDisconnect):
            if not await self._admit():
                return
            self._context.hub.join(self._outbox)
            sending = asyncio.create_task(self._send())
            try:
                await self._receive()
            finally:
                self._context.hub.leave(self._outbox)
                sending.cancel()
                await asyncio.gather(sending, return_exceptions=True)

    async def _admit(self) -> bool:
        """Accept the connection and learn who it is, unless too many others are unknown."""
        unknown = self._context.unknown
        if len(unknown) >= MAX_UNKNOWN:
            await self._socket.close(CLOSE_FULL, "too many connections")
            return False
        unknown.add(self)
        try:
            await self._socket.accept()
            return await self._greet()
        finally:
            unknown.discard(self)

    async def _greet(self) -> bool:
        """Learn who it is; close where it may not look."""
        if self._context.hub.browsers >= MAX_BROWSERS:
            await self._socket.close(CLOSE_FULL, "too many pages are open")
            return False
        try:
            hello = await asyncio.wait_for(self._hello(), HELLO_TIMEOUT_S)
        except TimeoutError:
            await self._socket.close(CLOSE_TOO_SLOW, "no greeting came")
            return False
        if hello is None:
            await self._socket.close(CLOSE_TOO_LARGE, "the greeting is too long")
            return False
        token = hello.get("token", "") if hello.get("type") == "hello" else ""
        self._role = self._context.tokens.role_of(token if isinstance(token, str) else "")
        if self._role is Role.NOBODY:
            if token:
                log.warning("a wrong token was presented")
                await asyncio.sleep(WRONG_TOKEN_DELAY_S)
            await self._socket.close(CLOSE_DENIED, "wrong token" if token else "token needed")
            return False
        self._outbox.offer({"welcome": json.dumps(self._welcome())})
        return True

    def _welcome(self) -> dict[str, Any]:
        return {
            "role": self._role.name.lower(),
            "can_command": self._role is Role.OPERATOR and self._context.command_queue is not None,
            "accepts_operators": self._context.tokens.operator is not None,
            "needs_token": not self._context.tokens.is_open,
            "columns": {"servo": SERVO_COLUMNS, "path": PATH_COLUMNS},
            "mounting_score": MOUNTING_SCORE,
            "max_goal_bytes": MAX_MESSAGE_BYTES,
        }

    async def _send(self) -> None:
        with contextlib.suppress(WebSocketDisconnect, RuntimeError):
            while True:
                text, images = await self._outbox.next()
                if text is not None:
                    await self._socket.send_text(text)
                for image in images:
                    await self._socket.send_bytes(image)

    async def _receive(self) -> None:
        while True:
            message = read_message(*await self._next_payload())
            kind = message.get("type")
            if kind == "seen":
                self._outbox.confirm()
            elif kind == "ping":
                self._pong(message, self._context.clock())
            elif kind == "watch":
                self._context.hub.watch(self._outbox, str(message.get("vehicle")))
            elif kind == "command":
                self._on_command(message)
            else:
                await self._socket.close(CLOSE_UNREADABLE, "message not understood")
                return

    async def _hello(self) -> dict[str, Any] | None:
        """First JSON object, None where it is too long to be read."""
        text, data = await self._next_payload()
        if data is not None or (text is not None and len(text) > MAX_HELLO_BYTES):
            return None
        return read_message(text, None)

    async def _next_payload(self) -> tuple[str | None, bytes | None]:
        """Text or bytes of the next message."""
        received = await self._socket.receive()
        if received["type"] == "websocket.disconnect":
            raise WebSocketDisconnect(received.get("code", 1000))
        return received.get("text"), received.get("bytes")

    def _pong(self, message: dict[str, Any], now: Moment) -> None:
        t = message.get("t")
        if isinstance(t, int | float):
            self._outbox.offer({"pong": json.dumps({"t": t, "server_ms": now.wall_ms})})

    def _on_command(self, message: dict[str, Any]) -> None:
        word, vehicle = str(message.get("command"))[:40], str(message.get("vehicle"))[:80]
        queue = self._context.command_queue
        if self._role is not Role.OPERATOR or queue is None:
            self._answer(word, vehicle, (False, "not sent: this page may only look"))
        elif self._is_one_too_many(word, vehicle):
            self._answer(word, vehicle, (False, "not sent: earlier commands are not answered yet"))
        else:
            running = self._run_command(queue, word, vehicle, commanded_goal(message))
            task = asyncio.create_task(running)
            self._pending[task] = word, vehicle
            task.add_done_callback(self._pending.pop)

    def _is_one_too_many(self, word: str, vehicle: str) -> bool:
        pending = list(self._pending.values())
        if word not in STOPS:
            return len(pending) >= MAX_PENDING_COMMANDS
        is_repeated = pending.count((word, vehicle)) >= MAX_PENDING_COMMANDS
        return is_repeated or len(pending) >= MAX_PENDING_STOPS

    async def _run_command(
        self, queue: CommandQueue, word: str, vehicle: str, goal: GoalCommand | None
    ) -> None:
        threads = self._context.stop_threads if word in STOPS else None
        loop = asyncio.get_running_loop()
        answer = await loop.run_in_executor(threads, queue.give, vehicle, word, goal)
        log.info("command %s for %s: %s", word, vehicle, answer[1])
        self._answer(word, vehicle, answer)

    def _answer(self, word: str, vehicle: str, answer: tuple[bool, str]) -> None:
        accepted, text = answer
        told = {"command": word, "vehicle": vehicle, "accepted": accepted, "text": text}
        self._outbox.append("answers", [json.dumps(told)])


def read_message(text: str | None, data: bytes | None) -> dict[str, Any]:
    """Read a message; what cannot be read is taken for an empty one.

    ``text`` is a JSON object. ``data`` is the length of a header (uint32, little-endian), the
    header as JSON, and an image, which is put into the message beside the header's values.
    """
    image = None
    if data is not None:
        if len(data) < _LENGTH.size:
            return {}
        end = _LENGTH.size + _LENGTH.unpack_from(data)[0]
        if end > min(len(data), _MAX_HEADER_BYTES):
            return {}
        header, image = data[_LENGTH.size : end], data[end:]
        text = header.decode(errors="replace")
    try:
        message = json.loads(text or "")
    except (ValueError, RecursionError):
        return {}
    if not isinstance(message, dict):
        return {}
    message.pop(_IMAGE, None)
    return message if image is None else message | {_IMAGE: image}


def commanded_goal(message: dict[str, Any]) -> GoalCommand | None:
    """Goal that came with a command, or None."""
    image = message.get(_IMAGE)
    if not isinstance(image, bytes):
        return None
    sidecar = message.get("sidecar", "")
    return GoalCommand(image, sidecar if isinstance(sidecar, str) else "")
