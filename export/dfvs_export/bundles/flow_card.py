"""The model card of dfvs-flow: what it is, how it came about, how good it is, what it is bad at."""

from collections.abc import Mapping

from dfvs_core.messages.manifest import Manifest
from dfvs_export.weights.flow import Weights
from dfvs_models.evaluation import LevelScore

_TEMPLATE = """# dfvs-flow

Sparse matches of a camera's image with a goal image, for visual servoing. Two graphs: `encode`
(keypoints with descriptors, once per image) and `match` (the partner of each, with a confidence).

- Encoder: XFeat (Potje et al., CVPR 2024). Matcher: LighterGlue, a LightGlue of width 96
  (Lindenberger et al., ICCV 2023).
- Input: {width} x {height} px, grey, 0 to 255; a negative pixel is outside of the image.
  Precision: {precision}.
- {parameters:.2f} million parameters. Origin: {origin}.
- Licence: Apache-2.0, as the published weights that it starts from.

## Training
{training}

## Accuracy
{accuracy}

## What it is bad at
- Roll of more than about 25 degrees; the service turns the goal image for that.
- Repeated structures: any of several like windows or balusters may be matched.
- Moving things: the scene is taken to be still.
"""


def model_card(
    weights: Weights, manifest: Manifest, scores: Mapping[str, LevelScore], pairs_name: str
) -> str:
    """Return the card's text; ``scores`` may be empty, and the card then says so."""
    states = (*weights.encoder.items(), *weights.matcher.items())
    return _TEMPLATE.format(
        width=manifest.input.width,
        height=manifest.input.height,
        precision=manifest.precision,
        parameters=sum(value.numel() for _, value in states) / 1e6,
        origin=manifest.origin,
        training=weights.training,
        accuracy=accuracy_table(scores, pairs_name),
    )


def accuracy_table(scores: Mapping[str, LevelScore], pairs_name: str) -> str:
    """Accuracy by level of motion as a card says it; ``scores`` may be empty."""
    if not scores:
        return "Not measured for this bundle."
    lines = [
        f"On `{pairs_name}`, over the pixels seen in both images, after the dense search:",
        "",
        "| motion | mean error | under 3 px | error of the more confident half | pairs |",
        "|---|---|---|---|---|",
    ]
    for level, s in scores.items():
        lines.append(
            f"| {level} | {s.epe_px:.2f} px | {100 * s.under_3px:.1f} % "
            f"| {s.confident_half_epe_px:.2f} px | {s.pairs} |"
        )
    return "\n".join(lines)
