"""What a check found: a table of ticks and crosses, or JSON."""

from __future__ import annotations

import json
from dataclasses import dataclass

from dfvs_core.gate.preflight import Check
from dfvs_core.schema import dump

TICK, CROSS = "✓", "✗"


@dataclass(frozen=True, slots=True)
class CheckReport:
    """All checks of one vehicle, in the order in which they were made."""

    vehicle: str
    checks: tuple[Check, ...]

    @property
    def ok(self) -> bool:
        """Tell whether there is no cross at all, advice included."""
        return all(check.ok for check in self.checks)

    def to_text(self) -> str:
        """Table with what to do for each cross."""
        width = max(len(check.name) for check in self.checks)
        lines = []
        for check in self.checks:
            mark = TICK if check.ok else CROSS
            lines.append(f"{mark} {check.name:<{width}}  {check.detail}".rstrip())
            if not check.ok and check.remedy:
                lines.append(f"  {'':<{width}}  → {check.remedy}")
        crosses = sum(not check.ok for check in self.checks)
        told = "all checks pass" if self.ok else f"{crosses} of {len(self.checks)} checks fail"
        return "\n".join([*lines, f"{self.vehicle}: {told}"])

    def to_json(self) -> str:
        """Document for machines."""
        checks = [dump(check) for check in self.checks]
        return json.dumps({"vehicle": self.vehicle, "ok": self.ok, "checks": checks}, indent=2)
