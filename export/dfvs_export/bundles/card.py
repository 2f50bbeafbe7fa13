"""Model cards: what a bundle is, how it came about, how good it is, what it is bad at."""

from collections.abc import Mapping

from dfvs_common.tables import markdown_table
from dfvs_models.depth_evaluation import MeasuredDepth
from dfvs_models.evaluation import LevelScore

_NOT_MEASURED = "Not measured for this bundle."
_FLOW_HEADS = ("motion", "mean error", "under 3 px", "error of the more confident half", "pairs")
_DEPTH_HEADS = ("images", "depth", "abs-rel", "RMSE", "within 25 %")


def model_card(name: str, about: str, accuracy: str, training: str = "", limits: str = "") -> str:
    """Text of a model card; a section without text is left out."""
    sections = {"Training": training, "Accuracy": accuracy, "What it is bad at": limits}
    texts = [f"## {title}\n{text}" for title, text in sections.items() if text]
    return "\n\n".join([f"# {name}", about, *texts]) + "\n"


def flow_accuracy(scores: Mapping[str, LevelScore], pairs_name: str) -> str:
    """Accuracy by level of motion; ``scores`` on the file ``pairs_name`` may be empty."""
    if not scores:
        return _NOT_MEASURED
    rows = [
        (
            level,
            f"{s.epe_px:.2f} px",
            f"{100 * s.under_3px:.1f} %",
            f"{s.confident_half_epe_px:.2f} px",
            str(s.pairs),
        )
        for level, s in scores.items()
    ]
    head = f"On `{pairs_name}`, over the pixels seen in both images, after the dense search:"
    return "\n".join([head, "", *markdown_table(_FLOW_HEADS, rows)])


def depth_accuracy(measured: Mapping[str, MeasuredDepth]) -> str:
    """Errors of depth by the file's label; ``measured`` may be empty."""
    if not measured:
        return _NOT_MEASURED
    rows = [
        (
            f"{result.images} of `{name}`",
            kind,
            f"{e.abs_rel:.3f}",
            f"{e.rmse_m:.2f} m",
            f"{100 * e.close:.1f} %",
        )
        for name, result in measured.items()
        for kind, e in (("metric", result.score.metric), ("scale aligned", result.score.aligned))
        if e is not None
    ]
    scales = [
        f"On `{name}` {_scale_error(r.score.scale_log)}"
        f"{100 * r.score.within_spread:.0f} % of pixels lie within the stated uncertainty."
        for name, r in measured.items()
    ]
    return "\n".join([*markdown_table(_DEPTH_HEADS, rows), "", *scales])


def _scale_error(scale_log: float | None) -> str:
    return "" if scale_log is None else f"ln of the scale is off by {scale_log:.2f} (rms), and "
