"""Who engages the service: the demo's pilot, the service itself, or a signed command."""

import enum
from collections.abc import Sequence

from dfvs_core.errors import ConfigError
from dfvs_sim.demo.flight.service_settings import settings_in_force

UNDER_WAY = frozenset({"ENGAGE", "SERVO", "HOLD"})
ENDED = frozenset({"DONE", "ABORT", "RELEASED"})
READY = frozenset({"READY"})


class Engagement(enum.Enum):
    """``gate.engage`` of the service, as far as the demo can fly with it."""

    PILOT = "pilot"
    AUTO = "auto"
    COMMAND = "command"

    @property
    def ready_states(self) -> frozenset[str]:
        """States that show the service ready, or beyond it where it does not wait for the pilot."""
        return READY if self is Engagement.PILOT else READY | UNDER_WAY | ENDED


def engagement_of(words: Sequence[str]) -> Engagement:
    """Who engages a service with these words; asks the service itself.

    Raises
    ------
    ConfigError
        If the service refuses the words, or would never engage.
    """
    engage = settings_in_force(words)["gate"]["engage"]
    if engage == "never":
        raise ConfigError(
            "the service is to engage never: nothing would be flown", "pilot, auto or command"
        )
    return Engagement(engage)
