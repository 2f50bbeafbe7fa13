"""The vehicle's status texts as a person reads them."""

from collections import deque
from dataclasses import dataclass
from typing import Any

from dfvs_common.status_text import plain_text

_KEPT = 20


@dataclass(frozen=True, slots=True)
class _Text:
    t_ns: int
    number: int
    raw: str


class StatusTexts:
    """Last STATUSTEXTs, chunks of a long text joined."""

    def __init__(self) -> None:
        self._texts: deque[_Text] = deque(maxlen=_KEPT)

    def add(self, message: Any, t_ns: int) -> None:
        """Take a STATUSTEXT that arrived at a monotonic time."""
        last = self._texts[-1] if self._texts else None
        if last is not None and message.chunk_seq > 0 and message.id == last.number != 0:
            self._texts[-1] = _Text(last.t_ns, last.number, last.raw + message.text)
        else:
            self._texts.append(_Text(t_ns, message.id, message.text))

    @property
    def all(self) -> tuple[tuple[int, str], ...]:
        """Texts with their arrival (monotonic ns), oldest first."""
        return tuple((text.t_ns, plain_text(text.raw.partition("\0")[0])) for text in self._texts)
