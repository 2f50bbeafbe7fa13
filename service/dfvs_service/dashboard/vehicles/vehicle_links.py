"""Link by which each vehicle is reached, where two links may carry the same name."""

import logging
import threading
from dataclasses import dataclass

from dfvs_service.settings.sections import ZenohSection

MAX_VEHICLES = 64

_SILENCE_NS = 2_000_000_000
"""Silence on its link after which a vehicle may have moved to another one."""

log = logging.getLogger("dfvs.dashboard")


@dataclass(slots=True)
class _Owner:
    link: ZenohSection
    received_ns: int
    warning: str = ""


class VehicleLinks:
    """Keeps vehicles of one name apart: the link that a name was heard by first counts.

    A vehicle that moves to another link is followed once it is silent on the first one. A name
    that two links carried at the same time stays with the first one, silent or not: the page does
    not turn to another vehicle. May be called on any thread.
    """

    def __init__(self) -> None:
        self._owners: dict[str, _Owner] = {}
        self._lock = threading.Lock()

    def admit(self, vehicle: str, link: ZenohSection, now_ns: int) -> bool:
        """Whether what a link brings of a vehicle counts."""
        with self._lock:
            owner = self._owners.get(vehicle)
            if owner is None and len(self._owners) >= MAX_VEHICLES:
                return False
            if owner is None:
                owner = self._owners[vehicle] = _Owner(link, now_ns)
            if owner.link is not link and now_ns - owner.received_ns <= _SILENCE_NS:
                _warn(vehicle, owner, link)
            if owner.link is not link and owner.warning:
                return False
            owner.link, owner.received_ns = link, now_ns
            return True

    def get(self, vehicle: str) -> ZenohSection | None:
        """Link by which a vehicle is reached, None where it was not heard."""
        owner = self._owners.get(vehicle)
        return None if owner is None else owner.link

    def warnings(self) -> dict[str, str]:
        """Warning about each name that two links carry."""
        with self._lock:
            return {name: owner.warning for name, owner in self._owners.items() if owner.warning}


def _warn(vehicle: str, owner: _Owner, other: ZenohSection) -> None:
    if owner.warning:
        return
    shown, hidden = (", ".join(link.connect) for link in (owner.link, other))
    owner.warning = (
        f"{vehicle} is heard by {shown} and by {hidden}; only the first is shown and commanded: "
        "give every vehicle a vehicle.name of its own, and start the dashboard again"
    )
    log.warning("%s", owner.warning)
