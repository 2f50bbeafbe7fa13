"""The matrix as a table: JSON for machines, Markdown and HTML for people."""

import json
import math
import os
import platform
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from dfvs_common.atomic_file import write_atomic
from dfvs_common.tables import markdown_table
from dfvs_common.templates import templates
from dfvs_core.gate.states import GateState
from dfvs_robustness.answers.report import html_section, markdown_lines
from dfvs_robustness.faults.fault import Fault, Outcome

_MAX_CAUSE = 80
_TIMES = ("p50 ms", "p99 ms", "max ms")

_NOTE = (
    "The real `dfvs-service` flies a simulated vehicle and is disturbed from outside. Times go",
    "from the fault (for frames: from the capture of the last good one; for a takeover: from the",
    "message that tells of it) to the first zero setpoint, or the state or silence that had to",
    "follow, by the vehicle's own record; 0 means that nothing moved any more when it happened.",
    "Every case draws its place, its phase and what is random in its fault from its own seed;",
    "where a service survives a fault, it is healed and flies on into the next case.",
    "A case is repeated where the state was not reached, where frames were late without any",
    "reason, or where it failed while the simulated vehicle itself stood still: the machine was",
    "too busy with other work then. Three attempts without a verdict count as a failure.",
    "Results beside a stand-in are no flight evidence, and no failure in N cases bounds the rate",
    "for these faults only.",
)


@dataclass(frozen=True, slots=True)
class Row:
    """One fault in one state over all seeds; times in ms."""

    fault: str
    state: str
    seeds: int
    passed: int
    p50_ms: float | None
    p99_ms: float | None
    max_ms: float | None
    limit_ms: float
    what: str
    seen_by: str
    reaction: str
    cause: str
    problems: tuple[str, ...]
    repeated: int
    times_ms: tuple[float, ...]

    @property
    def numbers(self) -> tuple[str, ...]:
        """Median, 99th percentile, maximum and limit, for people."""
        times = (self.p50_ms, self.p99_ms, self.max_ms)
        return (*("–" if t is None else f"{t:.0f}" for t in times), f"{self.limit_ms:g}")


def make_rows(outcomes: Sequence[Outcome], faults: Mapping[str, Fault]) -> list[Row]:
    """Rows in the order of the faults and the states."""
    order = {name: i for i, name in enumerate(faults)}
    states = list(GateState)
    found: dict[tuple[str, str], list[Outcome]] = {}
    for outcome in outcomes:
        if outcome.fault in faults:
            found.setdefault((outcome.fault, outcome.state), []).append(outcome)
    keys = sorted(found, key=lambda k: (order[k[0]], states.index(GateState(k[1]))))
    return [_row(faults[fault], found[fault, state]) for fault, state in keys]


def _row(fault: Fault, outcomes: Sequence[Outcome]) -> Row:
    times = [o.reaction_ms for o in outcomes if math.isfinite(o.reaction_ms)]
    p50, p99, most = np.percentile(times, [50, 99, 100]) if times else (None, None, None)
    causes = Counter(o.cause[:_MAX_CAUSE] for o in outcomes if o.cause)
    return Row(
        fault=fault.name,
        state=outcomes[0].state,
        seeds=len(outcomes),
        passed=sum(o.passed for o in outcomes),
        p50_ms=_rounded(p50),
        p99_ms=_rounded(p99),
        max_ms=_rounded(most),
        limit_ms=fault.limit_ms,
        what=fault.what,
        seen_by=fault.seen_by,
        reaction=fault.reaction.value,
        cause=causes.most_common(1)[0][0] if causes else "",
        problems=tuple(sorted({o.problem for o in outcomes if o.problem})),
        repeated=sum(o.attempts > 1 for o in outcomes),
        times_ms=tuple(round(t, 1) for t in times),
    )


def _rounded(value: float | None) -> float | None:
    return None if value is None else round(float(value), 1)


@dataclass(frozen=True, slots=True)
class Report:
    """Results of the matrix."""

    rows: Sequence[Row]
    violations: Sequence[str]
    """Of the invariants, in any run of the service."""
    not_run: int
    """Planned cases without an outcome."""
    command: str = ""
    remark: str = ""
    """What its readers should know."""
    answers: Mapping[str, Any] | None = None
    """Document of ``dfvs-robustness answers --json``."""

    @property
    def passed(self) -> bool:
        """Whether every planned case was run and passed, and nothing was violated."""
        every = all(row.passed == row.seeds for row in self.rows)
        return every and not self.not_run and not self.violations

    @property
    def verdict(self) -> str:
        """One sentence."""
        rows = self.rows
        cases, passed = sum(r.seeds for r in rows), sum(r.passed for r in rows)
        repeated = sum(r.repeated for r in rows)
        again = f", {repeated} of them not at the first attempt" if repeated else ""
        counts = [r.seeds for r in rows]
        missing = f", {self.not_run} not run" if self.not_run else ""
        seeds = f", {min(counts)} to {max(counts)} seeds a row" if counts else ""
        return (
            f"{passed} of {cases} cases passed{again}{missing} "
            f"({len({r.fault for r in rows})} faults, {len(rows)} rows{seeds}); "
            f"{len(self.violations)} violation{'' if len(self.violations) == 1 else 's'} of I1–I9"
        )

    def write_json(self, path: Path) -> None:
        """Write the table for machines, whole or not at all."""
        rows = [asdict(row) for row in self.rows]
        for row in rows:
            del row["times_ms"]
        document = {"rows": rows, "violations": list(self.violations), "not_run": self.not_run}
        text = json.dumps(document, indent=1, ensure_ascii=False) + "\n"
        write_atomic(path, text.encode())

    def write_pages(self, page: Path) -> None:
        """Write the HTML page and, beside it, the same as Markdown."""
        write_atomic(page, self.html().encode())
        write_atomic(page.with_suffix(".md"), self.markdown().encode())

    def markdown(self) -> str:
        """Table for people, in a text."""
        heads = ("fault", "in state", "seen by", "reaction", "passed", *_TIMES, "limit ms")
        rows = [
            (r.what, r.state, r.seen_by, r.reaction, f"{r.passed}/{r.seeds}", *r.numbers)
            for r in self.rows
        ]
        lines = [
            *("# Faults", ""),
            f"{self.verdict}. Made by `{self.command}` on {_machine()}.",
            *("", *_NOTE, ""),
            *([self.remark, ""] if self.remark else []),
            *markdown_table(heads, rows),
        ]
        lines += ["", *(f"- {text}" for text in self.violations)] if self.violations else []
        lines += ["", *markdown_lines(self.answers)] if self.answers is not None else []
        return "\n".join(lines).rstrip() + "\n"

    def html(self) -> str:
        """Table for people, in one file without any other."""
        template = templates("dfvs_robustness.faults").get_template("report.html.j2")
        answers = "" if self.answers is None else html_section(self.answers)
        note = " ".join(_NOTE)
        return template.render(report=self, machine=_machine(), note=note, answers=answers)


def _machine() -> str:
    return f"{platform.machine()}, {os.cpu_count()} cores, Python {platform.python_version()}"
