"""The page's files in a browser, and a server whose words a test chooses."""

import json
import time

from browser_page import Page

from dfvs_service.dashboard.app import PAGE
from dfvs_service.dashboard.vehicles.vehicle_model import PATH_COLUMNS, SERVO_COLUMNS

URL = "http://dashboard.test/"
TOKEN = "operator-of-a-test" * 2
TYPES = {".html": "text/html", ".js": "text/javascript", ".css": "text/css"}


class ScriptedServer:
    """Answers as the hub does for vehicles of these names; closes and falls silent when told."""

    def __init__(self, context, *vehicles):
        self.vehicles = vehicles
        self.accepts = True
        """Whether a new connection is taken."""
        self.socket = None
        self.tokens = []
        """Of every greeting."""
        self.watched = []
        """Vehicles that were asked for on this connection."""
        self.commands = []
        context.route(f"{URL}**", self.on_request)
        context.route_web_socket("ws://dashboard.test/live", self.on_socket)
        self.page = Page(context, URL)

    def on_request(self, route):
        path = PAGE / (route.request.url.removeprefix(URL) or "index.html")
        kind = TYPES.get(path.suffix, "image/svg+xml")
        route.fulfill(body=path.read_bytes(), content_type=kind)

    def on_socket(self, socket):
        if not self.accepts:
            socket.close(code=1001)
            return
        self.socket, self.watched = socket, []
        socket.on_message(self.on_message)

    def on_message(self, text):
        message = json.loads(text)
        match message["type"]:
            case "hello":
                self.greet(message["token"])
            case "ping":
                self.say(pong={"t": message["t"], "server_ms": time.time() * 1e3})
            case "watch":
                self.watched.append(message["vehicle"])
                if message["vehicle"] in self.vehicles:
                    self.say(watching=message["vehicle"], state=self.state())
            case "command":
                self.commands.append((message["vehicle"], message["command"]))

    def greet(self, token):
        self.tokens.append(token)
        if token not in ("", TOKEN):
            self.socket.close(code=4401, reason="wrong token")
            return
        is_operator = token == TOKEN
        welcome = {
            "role": "operator" if is_operator else "viewer",
            "can_command": is_operator,
            "accepts_operators": True,
            "needs_token": False,
            "columns": {"servo": SERVO_COLUMNS, "path": PATH_COLUMNS},
            "mounting_score": 5.0,
            "max_goal_bytes": 800_000,
        }
        self.say(welcome=welcome, vehicles=self.listing())

    def say(self, **update):
        self.socket.send(json.dumps(update))

    def list_vehicles(self, *vehicles):
        self.vehicles = vehicles
        self.say(vehicles=self.listing())

    def listing(self):
        t_ms = time.time() * 1e3
        return [{"name": name, "state": "SERVO", "t_ms": t_ms} for name in self.vehicles]

    @staticmethod
    def state():
        t_ms = time.time() * 1e3
        return {
            **{"state": "SERVO", "cause": "good data", "t_ms": t_ms, "since_ms": t_ms},
            **{"accepts_commands": True, "warnings": [], "battery": None, "mode": "OFFBOARD"},
        }

    def close(self, code=1001, reason=""):
        """Close the connection; returns when the page has greeted on the next one."""
        greetings = len(self.tokens)
        self.socket.close(code=code, reason=reason)
        self.until(lambda: len(self.tokens) > greetings)

    def until(self, condition, patience_s=10.0):
        deadline = time.monotonic() + patience_s
        while not condition():
            assert time.monotonic() < deadline
            self.page.page.wait_for_timeout(20)
