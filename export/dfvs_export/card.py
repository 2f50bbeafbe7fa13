"""The model card of dfvs-flow: what it is, how it came about, how good it is, what it is bad at."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from dfvs_core.manifest import Manifest
from dfvs_core.matching.evaluation import LevelScore
from dfvs_export.train.checkpoint import Checkpoint

_TEMPLATE = """# dfvs-flow

Dense matching of a camera's picture to a goal picture, for visual servoing: flow in px and a
confidence from 0 to 1 for every pixel. Two graphs: `encode` (once per picture) and `match`.

- Input: {width} x {height} px, RGB, 0 to 1; works at {working}. Precision: {precision}.
- {parameters:.2f} million parameters, {steps} steps of training.
- Licence: Apache-2.0, weights and code alike.

## Training data
No photograph and no outside scene: rooms of random boxes, columns, thin bars and sheets with
procedural textures, ray cast with exact flow and covisibility (`dfvs-export sheet` draws some).
{others}
Pictures are disturbed on their own: exposure, white balance,
blur, glare, noise, JPEG damage.

## Schedule
{schedule}

## Accuracy
{accuracy}

## What it is bad at
- It was trained for {steps} steps on {device}; large motion is where too few show first.
- Rooms are made of planes in its training: foliage, water, crowds and outdoor distance were not
  in it. Neither were moving things: the scene is taken to be still.
- Plain walls are filled in from the edges around them; confidence is the thing to trust there.
- Overlap under about a tenth of the picture, and roll beyond 55 degrees, were never shown to it.
"""


def model_card(
    checkpoint: Checkpoint,
    manifest: Manifest,
    scores: Mapping[str, LevelScore],
    pairs_name: str,
) -> str:
    """Return the card's text; ``scores`` may be empty, and the card then says so."""
    parameters = sum(v.numel() for v in checkpoint.average.values()) / 1e6
    return _TEMPLATE.format(
        width=manifest.input.width,
        height=manifest.input.height,
        working=" x ".join(
            map(str, manifest.working_size or (manifest.input.width, manifest.input.height))
        ),
        precision=manifest.precision,
        parameters=parameters,
        steps=checkpoint.step,
        schedule=_schedule(checkpoint.origin),
        others=_others(checkpoint),
        device=" and ".join(
            sorted({run["settings"].get("device", "cpu") for run in checkpoint.origin})
        ),
        accuracy=accuracy_table(scores, pairs_name),
    )


def _others(checkpoint: Checkpoint) -> str:
    """Say what else may have been in the shards that the last run drew from."""
    folder = checkpoint.origin[-1]["settings"].get("pairs")
    if checkpoint.notes:
        return checkpoint.notes
    if folder:
        return f"The last run drew from all shards in `{Path(folder).name}`, whoever made them."
    return "Nothing else."


def _schedule(origin: tuple[Mapping[str, Any], ...]) -> str:
    lines = ["| run | size | pairs a step | peak learning rate | budget | precision | seed |"]
    lines.append("|---|---|---|---|---|---|---|")
    for number, run in enumerate(origin, 1):
        s = run["settings"]
        budget = f"{s['steps']} steps" if s["steps"] else f"{s['minutes']:g} min at most"
        lines.append(
            f"| {number} | {s['size'][0]} x {s['size'][1]} | {s['pairs_per_step']} both ways "
            f"| {s['learning_rate']:g} | {budget} | {s['precision']} | {s['seed']} |"
        )
    return "\n".join(lines)


def accuracy_table(scores: Mapping[str, LevelScore], pairs_name: str) -> str:
    """Accuracy by level of motion as a card says it; ``scores`` may be empty."""
    if not scores:
        return "Not measured for this bundle."
    lines = [
        f"On `{pairs_name}`, over the pixels seen in both pictures:",
        "",
        "| motion | mean error | under 3 px | error of the surer half | pairs |",
        "|---|---|---|---|---|",
    ]
    for level, s in scores.items():
        lines.append(
            f"| {level} | {s.epe_px:.2f} px | {100 * s.under_3px:.1f} % "
            f"| {s.sure_half_epe_px:.2f} px | {s.pairs} |"
        )
    return "\n".join(lines)
