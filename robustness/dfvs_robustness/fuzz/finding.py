"""Violations of invariants, and the episodes that lead to them."""

from dataclasses import dataclass
from typing import Generic, TypeVar

E = TypeVar("E")


class InvariantError(Exception):
    """An invariant, named by its rule (such as I1), does not hold; the text says what was seen."""

    def __init__(self, rule: str, text: str) -> None:
        self.rule = rule
        self.text = text
        super().__init__(f"{rule}: {text}")


@dataclass(frozen=True, slots=True)
class Finding(Generic[E]):
    """An episode that ended in a violation."""

    episode: E
    rule: str
    text: str
