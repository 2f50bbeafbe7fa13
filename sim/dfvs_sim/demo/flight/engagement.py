"""Who engages the service: the demo's pilot, the service itself, or a signed command."""

import enum
import tomllib
from collections.abc import Iterator, Sequence
from pathlib import Path

from dfvs_core.errors import ConfigError

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
    """Read who engages from words for ``dfvs-service``, as it reads them itself.

    ``--engage`` counts before ``--set gate.engage=...``, and that before a settings file. Words
    that the service will refuse are left to it.

    Raises
    ------
    ConfigError
        If the service would never engage.
    """
    options = list(option_values(words, "--engage"))
    settings = [
        text.partition("=")[2].strip("'\"")
        for text in option_values(words, "--set")
        if text.partition("=")[0] == "gate.engage"
    ]
    files = [_in_file(Path(text)) for text in option_values(words, "--config")]
    given = [*options[-1:], *settings[-1:], *files[-1:], Engagement.PILOT.value]
    if given[0] == "never":
        raise ConfigError(
            "the service is to engage never: nothing would be flown", "pilot, auto or command"
        )
    try:
        return Engagement(given[0])
    except ValueError:
        return Engagement.PILOT


def option_values(words: Sequence[str], option: str) -> Iterator[str]:
    """Values of an option, in either spelling."""
    for i, word in enumerate(words):
        if word == option:
            yield from words[i + 1 : i + 2]
        elif word.startswith(f"{option}="):
            yield word.partition("=")[2]


def _in_file(path: Path) -> str:
    try:
        settings = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return Engagement.PILOT.value
    gate = settings.get("gate", {})
    value = gate.get("engage") if isinstance(gate, dict) else None
    return str(value or Engagement.PILOT.value)
