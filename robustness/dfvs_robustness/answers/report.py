"""Table of the answers to commands, for the report of the fault matrix."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from dfvs_common.tables import markdown_table
from dfvs_common.templates import templates
from dfvs_core.errors import ConfigError
from dfvs_core.gate.states import GateState
from dfvs_robustness.answers.measurement import ANSWER_MS, LEAST_STATE_HZ, MOST_GAP_MS

TITLE = "Answers to commands"
_HEADS = (
    "in state",
    "goal",
    "hold",
    "abort",
    "answered once and truly",
    "p50 ms",
    "p99 ms",
    "max ms",
)


def read_answers(path: Path) -> dict[str, Any]:
    """Results that ``dfvs-robustness answers --json`` wrote.

    Raises
    ------
    ConfigError
        If the file cannot be read or holds something else.
    """
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
        _rows(document)
        _note(document)
    except (OSError, ValueError, KeyError, TypeError, IndexError) as error:
        made_by = "a file of: dfvs-robustness answers --json FILE"
        raise ConfigError(f"{path} holds no answer times ({error})", made_by) from error
    return dict(document)


def markdown_lines(document: Mapping[str, Any]) -> list[str]:
    """Section of a Markdown text."""
    table = markdown_table(_HEADS, _rows(document))
    problems = [f"- {text}" for text in _problems(document)]
    return [f"## {TITLE}", "", _note(document), "", *table, "", *problems]


def html_section(document: Mapping[str, Any]) -> str:
    """Section of an HTML page."""
    return (
        templates("dfvs_robustness.answers")
        .get_template("answers.html.j2")
        .render(
            title=TITLE,
            note=_note(document),
            heads=_HEADS,
            rows=_rows(document),
            problems=_problems(document),
        )
    )


def _rows(document: Mapping[str, Any]) -> list[tuple[str, ...]]:
    """Cells of every state, and of all together."""
    rows = []
    for state in (*GateState, None):
        tries = [t for t in document["tries"] if state is None or t["state"] == state]
        if not tries:
            continue
        times = np.array([t["answer_ms"] for t in tries])
        quantiles = np.percentile(times, [50, 99, 100], method="higher")
        count = {name: sum(t["action"] == name for t in tries) for name in ("hold", "abort")}
        views = {t["goal_in_view"] for t in tries}
        view = "" if len(views) > 1 else "in view" if views == {True} else "out of view"
        good = sum(not t["problem"] for t in tries)
        counts = (str(count["hold"]), str(count["abort"]), f"{good}/{len(tries)}")
        rows.append((str(state or "all"), view, *counts, *(f"{q:.0f}" for q in quantiles)))
    return rows


def _note(document: Mapping[str, Any]) -> str:
    rate = document["rate"]
    return (
        f"{len(document['tries'])} commands with {document['busy']} busy processes on "
        f"{document['cores']} cores, each sent once; from sending to the arrival of the answer, "
        f"limit {ANSWER_MS:g} ms in 99 of 100. An answer is true where the gate then did what it "
        f"says. The state, in PREFLIGHT with the goal out of view and the same load, came at "
        f"{rate['rate_hz']:.2f} Hz over {rate['seconds']:g} s (10 asked, limit "
        f"{LEAST_STATE_HZ:g}), the largest gap was {rate['largest_gap_ms']:.0f} ms (limit "
        f"{MOST_GAP_MS:g}); perception had no track of the goal in {100 * rate['searched']:.0f} % "
        f"of the frames that it looked at; median {rate['frame_ms']:.0f} ms from capture to report."
    )


def _problems(document: Mapping[str, Any]) -> list[str]:
    return [
        f"{t['action']} in {t['state']}: {t['problem']}" for t in document["tries"] if t["problem"]
    ]
