"""Command queue of the page: signed commands and their answers."""

import dataclasses
from collections.abc import Callable

from dfvs_core.errors import ConfigError, DfvsError
from dfvs_core.gate.events import Action
from dfvs_core.messages.goal_command import GoalCommand
from dfvs_core.messages.image import image_size
from dfvs_service.command import UnansweredError, send_command
from dfvs_service.settings.config import ServiceConfig
from dfvs_service.settings.sections import VehicleSection, ZenohSection

COMMAND_TIMEOUT_S = 3.0

STOPS = frozenset({Action.HOLD, Action.ABORT})
"""Commands that can do no harm."""
_USED_CHALLENGE = "rejected: its challenge was used"
"""Beginning of the gate's answer to a command whose challenge another one has used up."""

FindEndpoint = Callable[[str], ZenohSection | None]
Send = Callable[[ServiceConfig, bytes, Action, float, GoalCommand | None], str]


class CommandQueue:
    """Gives commands to vehicles; blocks, so it is called on worker threads.

    ``key`` signs the commands. ``find`` tells how to reach a vehicle by its name. ``send`` signs
    and sends a command, and returns the gate's answer.
    """

    def __init__(self, key: bytes, find: FindEndpoint, send: Send = send_command) -> None:
        self._key = key
        self._find = find
        self._send = send

    def give(self, vehicle: str, word: str, goal: GoalCommand | None) -> tuple[bool, str]:
        """Send a command and wait for the gate's answer: whether it was accepted, and why not.

        Two commands at a time may carry the same challenge, which the gate accepts once: a Hold or
        an Abort that comes second is sent once more, with the next challenge.
        """
        try:
            answer = self._give(vehicle, word, goal)
        except UnansweredError as error:
            return False, f"not answered: {error}"
        except DfvsError as error:
            return False, f"not sent: {error}"
        return answer.startswith("accepted"), answer

    def _give(self, vehicle: str, word: str, goal: GoalCommand | None) -> str:
        zenoh = self._find(vehicle)
        if zenoh is None or word not in set(Action):
            raise ConfigError(f"command {word!r} for {vehicle!r}", "a known command and vehicle")
        action = Action(word)
        if (action is Action.GOAL) != (goal is not None):
            raise ConfigError(f"command {word!r} {'without' if goal is None else 'with'} an image")
        if goal is not None:
            image_size(goal.image)
        config = dataclasses.replace(ServiceConfig(), vehicle=VehicleSection(vehicle), zenoh=zenoh)
        answer = self._send(config, self._key, action, COMMAND_TIMEOUT_S, goal)
        if action in STOPS and answer.startswith(_USED_CHALLENGE):
            answer = self._send(config, self._key, action, COMMAND_TIMEOUT_S, goal)
        return answer
