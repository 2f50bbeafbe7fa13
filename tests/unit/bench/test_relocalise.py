"""Verdicts on pairs of wide baseline, and the command that measures them."""

import json
from dataclasses import asdict, replace

import numpy as np
import pytest
from tiny_scenes import CAMERA, NORTHWARD, scene_of, wall

from dfvs_bench.basin.cells import Cell
from dfvs_bench.basin.drawing import DrawnTask
from dfvs_bench.cli import main
from dfvs_bench.relocalisation.near_goal import Approach
from dfvs_bench.relocalisation.relocalise import (
    STAGES,
    Relocalisation,
    Verdict,
    judge,
    summarise,
    without,
)
from dfvs_core.geometry.poses import make_pose, so3_exp
from dfvs_core.matching.config import MatchingConfig
from dfvs_core.matching.correspondence import FlowField
from dfvs_sim.render.renderer import Renderer
from dfvs_sim.render.truth import exact_flow
from dfvs_sim.scene import builtin_room_path

OFF = make_pose(so3_exp(np.radians([3.0, -4.0, 10.0])), np.array([0.4, 0.1, 0.5]))
"""Pose of the goal in the current view."""


@pytest.fixture(scope="module")
def view():
    """Depth before a wall with a step in it, and the exact flow to the goal."""
    corners = np.concatenate([wall(4.0), wall(3.0, half_width_m=0.8)])
    depth_m = Renderer(scene_of(corners)).depth(CAMERA, NORTHWARD)
    flow = np.nan_to_num(exact_flow(CAMERA, NORTHWARD, depth_m, NORTHWARD @ OFF), nan=1e3)
    return depth_m, flow.astype(np.float32)


def verdict(view, flow=None, sure=1.0, truth=OFF):
    depth_m, exact = view
    confidence = np.full(depth_m.shape, sure, np.float32)
    return judge(FlowField(exact if flow is None else flow, confidence), depth_m, CAMERA, truth)


def test_a_flow_that_is_not_sure_says_nothing(view):
    assert verdict(view, sure=0.2) is Verdict.NONE


def test_a_flow_that_no_pose_explains_says_nothing(view, rng):
    flow = rng.uniform(-30.0, 30.0, view[1].shape).astype(np.float32)
    assert verdict(view, flow) is Verdict.NONE


@pytest.mark.parametrize(
    ("moved_m", "turned_deg", "expected"),
    [
        (0.10, 0.0, Verdict.RIGHT),
        (0.25, 0.0, Verdict.WRONG),
        (0.0, 4.8, Verdict.RIGHT),
        (0.0, 5.2, Verdict.WRONG),
    ],
)
def test_a_pose_is_right_within_15_percent_of_the_distance_and_5_degrees(
    view, moved_m, turned_deg, expected
):
    distance_m = np.linalg.norm(OFF[:3, 3])
    shift = make_pose(
        so3_exp(np.radians([0.0, turned_deg, 0.0])), np.array([moved_m * distance_m, 0.0, 0.0])
    )
    assert verdict(view, truth=OFF @ shift) is expected


def task(translation_m, overlap):
    pose = tuple(np.eye(4).ravel())
    return DrawnTask(
        "t", "room", Cell(translation_m, (20.0, 20.0, 40.0)), overlap, True, pose, pose
    )


NEAR = Approach((8.0, 12.0, 30.0), 0.001, 0.002)


def test_figures_are_counted_by_matcher_and_class():
    found = [
        Relocalisation("a", task(1.2, 0.25), Verdict.RIGHT, 100.0, NEAR),
        Relocalisation("a", task(1.2, 0.7), Verdict.WRONG, 300.0, NEAR),
        Relocalisation("a", task(4.0, 0.2), Verdict.NONE, 200.0, NEAR),
        Relocalisation("b", task(4.0, 1.0), Verdict.RIGHT, 50.0, replace(NEAR, error=None)),
    ]
    figures = summarise(found)
    a = figures["a"]
    assert (a["pairs"], a["right"], a["wrong"], a["none"]) == (3, 1, 1, 1)
    assert (a["mean_ms"], a["max_ms"]) == (200.0, 300.0)
    assert (a["tracked_p50_ms"], a["final_error"], a["final_none"]) == (12.0, 0.001, 0)
    assert (figures["b"]["final_error"], figures["b"]["final_none"]) == (None, 1)
    assert a["by_translation"]["1.2 m"] == {"pairs": 2, "right": 1, "wrong": 1, "none": 0}
    assert a["by_rotation"]["20/20/40"]["pairs"] == 3
    assert a["by_overlap"]["20% to 30%"]["pairs"] == 2
    assert figures["b"]["by_overlap"] == {
        "60% to 100%": {"pairs": 1, "right": 1, "wrong": 0, "none": 0}
    }


def measured(folder, *words):
    given = ["relocalise", str(builtin_room_path()), "--bundle", "classical", *words]
    assert main([*given, "--json", str(folder / "relocalise.json")]) == 0
    return json.loads((folder / "relocalise.json").read_text())


def test_the_command_measures_pairs_in_a_scene(tmp_path, capsys):
    document = measured(tmp_path, "--trials", "2", "--camera", "320x240")
    figures = document["matchers"]["classical"]
    assert 0.0 < figures["final_error"] < 0.005
    assert figures["pairs"] == 2
    assert figures["right"] + figures["wrong"] + figures["none"] == 2
    assert figures["max_ms"] >= figures["mean_ms"] > 0.0
    assert (document["camera"], document["seed"]) == ("320x240", 0)
    assert "classical" in capsys.readouterr().out


def test_each_of_several_cameras_is_a_row_with_tracked_time_and_final_error(tmp_path, capsys):
    figures = measured(tmp_path, "--trials", "1", "--camera", "128x96", "160x120")["matchers"]
    assert list(figures) == ["classical 128x96", "classical 160x120"]
    assert all(each["tracked_p50_ms"] > 0.0 for each in figures.values())
    assert "classical 160x120" in capsys.readouterr().out


@pytest.mark.parametrize("stage", STAGES)
def test_a_stage_that_is_left_out_changes_its_numbers_alone(stage):
    given, left_out = asdict(MatchingConfig()), asdict(without([stage]))
    assert {name for name in given if given[name] != left_out[name]} == set(STAGES[stage])
