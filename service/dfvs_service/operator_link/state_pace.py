"""Rate limit of the published state."""

from dataclasses import dataclass

from dfvs_service.pace import Pace


@dataclass(slots=True)
class StatePace:
    """Lets a gate's status through at a rate, and at once where its state is another one.

    The last state of a service that ends is followed by nothing that would show it.
    """

    pace: Pace
    _state: str = ""

    def due(self, state: str, now_ns: int) -> bool:
        """Whether to publish a status of this state."""
        if not self.pace.due(now_ns) and state == self._state:
            return False
        self._state = state
        return True
