"""What a flight leaves in its folder: a summary, the servo's documents, images and plots."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

from dfvs_sim.demo.flight import FlightLog
from dfvs_sim.demo.images import write_images
from dfvs_sim.demo.plots import write_plots
from dfvs_sim.demo.summary import FlightSummary, summarise


def write_results(log: FlightLog, folder: Path) -> FlightSummary:
    """Write all that is known of a flight; return its summary."""
    summary = summarise(log)
    replace_json(folder / "summary.json", summary.to_json())
    lines = (json.dumps(document) + "\n" for document in log.watch.servo)
    (folder / "servo.jsonl").write_text("".join(lines), encoding="utf-8")
    write_images(log, folder)
    write_plots(log, folder / "plots.png")
    return summary


def replace_json(path: Path, document: Any) -> None:
    """Write a JSON file whole or not at all."""
    partial = path.with_name(path.name + ".part")
    partial.write_text(json.dumps(document, indent=2, allow_nan=False) + "\n", encoding="utf-8")
    os.replace(partial, path)
