"""What a flight leaves in its folder: a summary and the servo's documents."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from dfvs_common.atomic_file import write_atomic
from dfvs_sim.demo.flight.flight import FlightLog
from dfvs_sim.demo.results.summary import FlightSummary, summarise


def write_results(log: FlightLog, folder: Path) -> FlightSummary:
    """Write all that is known of a flight; return its summary."""
    summary = summarise(log)
    replace_json(folder / "summary.json", summary.to_json())
    lines = (json.dumps(document) + "\n" for document in log.watch.servo)
    (folder / "servo.jsonl").write_text("".join(lines), encoding="utf-8")
    return summary


def replace_json(path: Path, document: Any) -> None:
    """Write a JSON file whole or not at all."""
    write_atomic(path, (json.dumps(document, indent=2, allow_nan=False) + "\n").encode())
