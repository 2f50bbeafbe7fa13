"""Depths of Fig. 2: as good as their sources, in the order of the paper, and printed as vectors."""

from functools import cache

import numpy as np
import pytest
from depth_bundle import bundle

from dfvs_bench.report.depth_figure import depth_figure, depth_views
from dfvs_bench.trials.task import BenchTask
from dfvs_core.geometry.camera import CameraModel
from dfvs_core.geometry.poses import make_pose
from dfvs_core.matching.classical import classical_matcher
from dfvs_models.depth import DepthNetwork
from dfvs_models.onnx_session import Execution
from dfvs_sim.render.renderer import Renderer
from dfvs_sim.scene import builtin_room_path
from dfvs_sim.scene.glb import load_glb
from dfvs_sim.viewpoints.poses import camera_pose

CAMERA = CameraModel.from_horizontal_fov(160, 120, np.radians(75))
GOAL = camera_pose((0.5, -1.0, -1.3), np.radians(40))
ASIDE = make_pose(np.eye(3), np.array([-1.2, 0.3, -0.3]))
TASK = BenchTask("room", builtin_room_path(), GOAL @ ASIDE, GOAL, CAMERA)
INVERSE_DEPTH = 0.5


@cache
def views(unit):
    network = DepthNetwork(bundle(np.full((60, 80), INVERSE_DEPTH), unit=unit), Execution(1))
    renderer = Renderer(load_glb(TASK.scene))
    return depth_views(TASK, renderer, classical_matcher(), network)


def test_depth_from_flow_has_the_true_shape_and_the_true_median():
    depths = views("1/m").depths
    assert list(depths) == ["true depth", "network depth", "flow depth"]
    true_m, flow_m = depths["true depth"], depths["flow depth"]
    assert np.median(flow_m) == pytest.approx(np.nanmedian(true_m))
    off = np.abs(np.log(flow_m / true_m))
    assert np.nanmedian(off) < 0.2
    constant_off = np.abs(np.log(np.nanmedian(true_m) / true_m))
    assert np.nanmedian(off) < 0.6 * np.nanmedian(constant_off)


def test_a_metric_network_is_shown_as_it_is_and_another_with_the_true_median():
    assert views("1/m").depths["network depth"] == pytest.approx(1.0 / INVERSE_DEPTH)
    scaled = views("relative").depths
    assert np.median(scaled["network depth"]) == pytest.approx(np.nanmedian(scaled["true depth"]))


def test_the_figure_is_the_same_file_every_time():
    rows = [views("1/m")]
    figure = depth_figure(rows)
    assert figure.startswith(b"<?xml")
    assert figure == depth_figure(rows)
