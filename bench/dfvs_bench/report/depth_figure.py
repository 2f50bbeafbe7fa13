"""The paper's Fig. 2 with our figures: image, true depth, depth by a network, depth from flow."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib import style
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine

from dfvs_bench.report.figures import COLUMN_IN, STYLE, file_of
from dfvs_bench.report.page import small
from dfvs_bench.trials.task import BenchTask
from dfvs_core.depth.flow_depth import FlowDepth
from dfvs_core.depth.network import DepthEstimator, goal_depth
from dfvs_core.depth.source import EarlierView
from dfvs_core.geometry.arrays import FloatArray, ImageArray
from dfvs_core.geometry.poses import invert_pose, se3_exp, se3_log
from dfvs_core.matching.matcher import Matcher
from dfvs_sim.render.renderer import Renderer

FIRST_STEP = 0.05
"""Share of the way to the goal between the two views that depth from flow is shown of."""

_BOUNDS_PERCENT = (2.0, 98.0)
_GAP = 0.05
_NO_DEPTH = "#dddddd"
_SIDES_IN, _HEAD_IN = 0.5, 0.2


@dataclass(frozen=True, slots=True, eq=False)
class DepthViews:
    """An image (H, W, 3) RGB and its depths (H, W) m by name; not finite where there is none."""

    task: str
    image: ImageArray
    depths: dict[str, FloatArray]


def depth_views(
    task: BenchTask, renderer: Renderer, matcher: Matcher, network: DepthEstimator | None
) -> DepthViews:
    """What the sources of depth say of the view after a first step from the start to the goal.

    Depth from flow is known up to a factor, and so is that of a network that is not metric: both
    are given the true median.
    """
    T_earlier = task.T_world_start
    step = se3_log(invert_pose(T_earlier) @ task.T_world_goal) * FIRST_STEP
    view = renderer.render(task.camera, T_earlier @ se3_exp(step), antialias=True)
    earlier = renderer.render(task.camera, T_earlier, antialias=True)
    true_m = np.where(view.depth_m > 0, view.depth_m, np.nan).astype(np.float64)
    median_m = float(np.nanmedian(true_m))
    depths = {"true depth": true_m}
    if network is not None:
        found = network.estimate(view.image, task.camera)
        depths["network depth"] = 1.0 / goal_depth(found, 1, median_m).structure.rho
    from_flow = _flow_depth(task, matcher, (view.image, earlier.image), se3_exp(step))
    depths["flow depth"] = from_flow * (median_m / float(np.median(from_flow)))
    return DepthViews(task.name, view.image, depths)


def _flow_depth(
    task: BenchTask,
    matcher: Matcher,
    images: tuple[ImageArray, ImageArray],
    T_earlier_current: FloatArray,
) -> FloatArray:
    """Depth (h, w), up to a factor, by the flow from the current image to the earlier one."""
    current, earlier = (matcher.encode(image) for image in images)
    flow = matcher.match(current, earlier)
    height, width = flow.confidence.shape
    camera = task.camera.scaled(width, height)
    pixels = camera.grid()
    seen = EarlierView(
        camera.normalise(pixels + flow.flow), flow.confidence.astype(np.float64), T_earlier_current
    )
    source = FlowDepth(near_m=0.0, far_m=np.inf)
    depth, _ = source.estimate(camera.normalise(pixels), seen, None)
    return np.asarray(depth.z_m, np.float64)


def depth_figure(rows: Sequence[DepthViews]) -> bytes:
    """SVG with a row of panels for every view, with one scale of depth for each row."""
    names = list(rows[0].depths)
    height, width = rows[0].image.shape[:2]
    panel_in = (COLUMN_IN - _SIDES_IN) / (1 + len(names))
    size = COLUMN_IN, _HEAD_IN + len(rows) * panel_in * (height / width + _GAP)
    with style.context(STYLE):
        layout = ConstrainedLayoutEngine(w_pad=0.01, h_pad=0.01, wspace=0.01, hspace=0.01)
        figure = Figure(figsize=size, layout=layout)
        panels = figure.subplots(len(rows), 1 + len(names), squeeze=False)
        for axes, row in zip(panels, rows, strict=True):
            _draw_row(figure, axes, row)
        for axes, name in zip(panels[0], ("image", *names), strict=True):
            axes.set_title(name, loc="center")
        return file_of(figure, "svg")


def _draw_row(figure: Figure, panels: Any, row: DepthViews) -> None:
    low, high = np.nanpercentile(row.depths["true depth"], _BOUNDS_PERCENT)
    colours = mpl.colormaps["viridis_r"].with_extremes(bad=_NO_DEPTH)
    panels[0].imshow(small(row.image))
    panels[0].set_ylabel(row.task, fontsize=6)
    for axes, depth_m in zip(panels[1:], row.depths.values(), strict=True):
        shown = axes.imshow(small(depth_m.astype(np.float32)), colours, vmin=low, vmax=high)
    bar = figure.colorbar(shown, ax=list(panels), pad=0.01, shrink=0.9, aspect=12, extend="both")
    bar.ax.tick_params(labelsize=5.5, length=1.5, pad=1)
    bar.outline.set_linewidth(0.4)
    for axes in panels:
        axes.set(xticks=[], yticks=[])
        axes.spines[:].set_visible(False)
        axes.grid(visible=False)
