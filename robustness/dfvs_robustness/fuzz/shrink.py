"""Make a failing list short: leave out what is not needed for the failure (delta debugging)."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import TypeVar

from dfvs_robustness.fuzz.episode import Life
from dfvs_robustness.fuzz.gate_fuzz import Finding, relive

T = TypeVar("T")


def shrink_list(items: list[T], fails: Callable[[list[T]], bool]) -> list[T]:
    """Leave out parts, then single items, as long as what is left still fails.

    Parameters
    ----------
    items : list
        Which fails.
    fails : callable
        Tells whether a list fails.
    """
    size = max(len(items) // 2, 1)
    while True:
        start, shortened = 0, False
        while start < len(items):
            rest = items[:start] + items[start + size :]
            if fails(rest):
                items, shortened = rest, True
            else:
                start += size
        if size == 1 and not shortened:
            return items
        size = max(size // 2, 1)


def shrink(finding: Finding) -> Finding:
    """Return a life with as few steps and events as still violate the same invariant."""
    life, rule = finding.life, finding.rule

    def fails(shorter: Life) -> bool:
        violation = relive(shorter)
        return violation is not None and violation.rule == rule

    if not fails(life):  # the twin of another time of day found it: nothing shorter is known
        return finding
    steps = shrink_list(life.steps, lambda steps: fails(dataclasses.replace(life, steps=steps)))
    for i in range(len(steps)):
        before, (t_ns, events), after = steps[:i], steps[i], steps[i + 1 :]
        few = shrink_list(
            list(events),
            lambda some, before=before, t_ns=t_ns, after=after: fails(  # type: ignore[misc]
                dataclasses.replace(life, steps=[*before, (t_ns, tuple(some)), *after])
            ),
        )
        steps = [*before, (t_ns, tuple(few)), *after]
    shortest = dataclasses.replace(life, steps=steps)
    violation = relive(shortest)
    return Finding(shortest, rule, finding.text if violation is None else violation.text)
