"""Table of several flights' summaries."""

from collections.abc import Mapping, Sequence
from typing import Any

_COLUMNS = (
    ("start m", "initial_translation_m", 1.0, "7.2f"),
    ("start deg", "initial_rotation_deg", 1.0, "9.1f"),
    ("final cm", "final_translation_m", 100.0, "8.2f"),
    ("final deg", "final_rotation_deg", 1.0, "9.2f"),
    ("time s", "duration_s", 1.0, "6.1f"),
    ("path", "path_ratio", 1.0, "4.2f"),
)
"""Heading, key in the summary, factor and format."""


def flight_table(documents: Sequence[Mapping[str, Any]]) -> str:
    """Table of summaries as JSON has them, a line each, and how many converged."""
    width = max([len("vehicle"), *(len(str(d["vehicle"])) for d in documents)])
    head = "  ".join(heading for heading, *_ in _COLUMNS)
    lines = [f"{'vehicle':<{width}}  seed  {head}  end"]
    for document in documents:
        cells = [_cell(document.get(key), factor, form) for _, key, factor, form in _COLUMNS]
        end = "converged" if document["converged"] else document["end_state"]
        lines.append(
            f"{document['vehicle']:<{width}}  {document['seed']:4d}  {'  '.join(cells)}  {end}"
        )
    converged = sum(bool(document["converged"]) for document in documents)
    return "\n".join([*lines, f"{converged} of {len(documents)} converged"])


def _cell(value: float | None, factor: float, form: str) -> str:
    if value is None:
        return "-".rjust(int(form.partition(".")[0]))
    return format(factor * value, form)
