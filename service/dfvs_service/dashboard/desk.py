"""Orders from the page: signed as ``dfvs-service command`` signs them, and answered in words."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

from dfvs_core.errors import DfvsError
from dfvs_core.gate.events import Action
from dfvs_service.config import ServiceConfig, VehicleSection, ZenohSection
from dfvs_service.orders import give_order

ORDER_TIMEOUT_S = 3.0
ORDERS = (Action.ENGAGE, Action.HOLD, Action.ABORT)

FindEndpoint = Callable[[str], ZenohSection | None]


class OrderDesk:
    """Gives orders to vehicles; blocks, so it is called on worker threads.

    Parameters
    ----------
    key : bytes
        Of signed commands.
    find : callable
        How to reach a vehicle by its name.
    """

    def __init__(self, key: bytes, find: FindEndpoint) -> None:
        self._key = key
        self._find = find

    def give(self, vehicle: str, word: str) -> tuple[bool, str]:
        """Order and wait for the gate's word: whether it was accepted, and why not."""
        try:
            action = Action(word)
            zenoh = self._find(vehicle)
            if zenoh is None or action not in ORDERS:
                return False, f"not sent: {word!r} for {vehicle!r} is no order that can be given"
            config = dataclasses.replace(
                ServiceConfig(), vehicle=VehicleSection(vehicle), zenoh=zenoh
            )
            answer = give_order(config, self._key, action, ORDER_TIMEOUT_S)
        except (DfvsError, ValueError) as error:
            return False, f"not sent: {error}"
        return answer.startswith("accepted"), answer
