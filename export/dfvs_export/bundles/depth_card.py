"""The model card of a depth bundle."""

from collections.abc import Mapping

from dfvs_core.messages.manifest import Manifest
from dfvs_models.depth_evaluation import MeasuredDepth

_TEMPLATE = """# {name}

Depth of one image along the optical axis. Origin: {origin}.

- Input: {width} x {height} px, RGB{focal}. Precision: {precision}.
- Output: {quantity}, unit {unit}, every {stride} px, with {spread}.
- Licence: {licence}.

{training}## Accuracy
{accuracy}
{limits}"""
_LIMITS = """
## What it is bad at
- Rooms and light unlike those that it was trained on; views from close to a wall.
- The size of things: its scale is a guess from what rooms are like, which motion corrects.
- Mirrors, glass and the open sky.
"""


def depth_card(manifest: Manifest, training: str, measured: Mapping[str, MeasuredDepth]) -> str:
    """Text of the model card.

    Parameters
    ----------
    manifest : Manifest
        Of a ``mono`` bundle.
    training : str
        A paragraph, empty for a published network, whose limits are not known either.
    measured : mapping
        Accuracy by the file's name, may be empty.
    """
    meaning, graph = manifest.depth, manifest.graphs["mono"]
    assert meaning is not None
    stated = f"a standard deviation of its logarithm of {meaning.spread} (assumed)"
    return _TEMPLATE.format(
        name=manifest.name,
        origin=manifest.origin,
        width=manifest.input.width,
        height=manifest.input.height,
        focal=" and the focal length over the width" if len(graph.inputs) > 1 else "",
        precision=manifest.precision,
        quantity=meaning.quantity.replace("-", " "),
        unit=meaning.unit,
        stride=meaning.stride,
        spread="the standard deviation of its logarithm" if meaning.spread is None else stated,
        licence=manifest.licence,
        training=f"## Training\n{training}\n\n" if training else "",
        accuracy=_accuracy(measured),
        limits=_LIMITS if training else "",
    )


def _accuracy(measured: Mapping[str, MeasuredDepth]) -> str:
    """Table of errors by file, or that nothing was measured."""
    if not measured:
        return "Not measured for this bundle."
    lines = ["| images | depth | abs-rel | RMSE | within 25 % |", "|---|---|---|---|---|"]
    for name, result in measured.items():
        errors = {"metric": result.score.metric, "scale aligned": result.score.aligned}
        lines += [
            f"| {result.images} of `{name}` | {kind} | {e.abs_rel:.3f} | {e.rmse_m:.2f} m "
            f"| {100 * e.close:.1f} % |"
            for kind, e in errors.items()
            if e is not None
        ]
    lines += [""] + [
        f"On `{name}` ln of the scale is off by {r.score.scale_log:.2f} (rms), and "
        f"{100 * r.score.within_spread:.0f} % of pixels lie within the stated uncertainty."
        for name, r in measured.items()
    ]
    return "\n".join(lines)
