"""Report of a check: a table or JSON."""

import enum
import json
from collections import Counter
from dataclasses import dataclass

from dfvs_core.gate.checks.preflight import Check
from dfvs_core.messages.schema import dump
from dfvs_service.supervisor.console import Colour, painted

_PREREQUISITE = {
    **dict.fromkeys(("estimator", "hold", "health", "battery", "parameters"), "link"),
    **dict.fromkeys(("advised parameters", "watch", "sole commander"), "link"),
    **dict.fromkeys(("goal", "mounting"), "frames"),
}
"""Check without which another one has nothing to judge by."""


class Status(enum.StrEnum):
    """What a check comes to."""

    PASS = "pass"
    WARNING = "warning"
    FAILURE = "failure"
    WAITING = "waiting"


_MARKS = {
    Status.PASS: ("✓", Colour.GREEN),
    Status.WARNING: ("!", Colour.YELLOW),
    Status.FAILURE: ("✗", Colour.RED),
    Status.WAITING: ("…", Colour.DIM),
}


@dataclass(frozen=True, slots=True)
class CheckReport:
    """All checks of one vehicle, in the order in which they were made."""

    vehicle: str
    checks: tuple[Check, ...]

    @property
    def ok(self) -> bool:
        """Whether nothing fails, or waits for what fails; warnings are no failures."""
        statuses = {self.status(check) for check in self.checks if not check.pending}
        return statuses <= {Status.PASS, Status.WARNING}

    def status(self, check: Check) -> Status:
        """Status of one of the checks; it waits where nothing is known to judge it by."""
        if check.pending or self._awaited(check):
            return Status.WAITING
        if check.ok:
            return Status.PASS
        return Status.FAILURE if check.binding else Status.WARNING

    def _awaited(self, check: Check) -> str:
        """Name of the failed check that this one needs, empty where there is none."""
        needed = _PREREQUISITE.get(check.name)
        return next((c.name for c in self.checks if c.name == needed and not c.ok), "")

    def to_text(self, *, colours: bool = False) -> str:
        """Table with what to do for each failure and warning."""
        width = max(len(check.name) for check in self.checks)
        lines = []
        for check in self.checks:
            mark, colour = _MARKS[self.status(check)]
            awaited = self._awaited(check)
            detail = f"waiting for {awaited}" if awaited else check.detail
            line = f"{mark} {check.name:<{width}}  {detail}".rstrip()
            lines.append(painted(line[0], colour) + line[1:] if colours else line)
            if not check.ok and not awaited and check.remedy:
                lines.append(f"  {'':<{width}}  → {check.remedy}")
        return "\n".join([*lines, f"{self.vehicle}: {self._summary()}"])

    def _summary(self) -> str:
        counts = Counter(map(self.status, self.checks))
        summary = []
        if counts[Status.FAILURE]:
            summary.append(f"{counts[Status.FAILURE]} of {len(self.checks)} checks fail")
        if counts[Status.WAITING]:
            summary.append(f"{counts[Status.WAITING]} waiting")
        if counts[Status.WARNING]:
            plural = "s" if counts[Status.WARNING] > 1 else ""
            summary.append(f"{counts[Status.WARNING]} warning{plural}")
        return ", ".join(summary if not self.ok else ["all checks pass", *summary])

    def to_json(self) -> str:
        """Document for machines."""
        checks = [{**dump(check), "status": self.status(check)} for check in self.checks]
        return json.dumps({"vehicle": self.vehicle, "ok": self.ok, "checks": checks}, indent=2)
