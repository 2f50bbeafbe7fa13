import os
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pytest
from depth_bundle import bundle
from onnx_network import write_bundle

from dfvs_bench.drone.bound import TimeBound
from dfvs_bench.drone.flights import since, within_s
from dfvs_bench.drone.levelled import levelled, levelled_task, turn_rad
from dfvs_bench.drone.limits import depth_network, velocity_limits
from dfvs_bench.drone.records import (
    FlightRecord,
    Setting,
    fits,
    read_records,
    record_path,
    write_record,
)
from dfvs_bench.drone.tables import flight_line, row, summarise, summary_line
from dfvs_bench.report.report import drone_section
from dfvs_bench.trials.provenance import input_digest
from dfvs_bench.trials.task import BenchTask
from dfvs_core.errors import ConfigError, GeometryError
from dfvs_core.gate.limits import VelocityLimits
from dfvs_core.geometry.camera import CameraModel
from dfvs_core.geometry.poses import make_pose, so3_exp
from dfvs_sim.demo.flight.service_settings import settings_in_force
from dfvs_sim.demo.flight.track import TrackPoint
from dfvs_sim.demo.options import Conditions, FlightOptions
from dfvs_sim.options import write_json
from dfvs_sim.viewpoints.poses import camera_pose

CAMERA = CameraModel(96, 72, 60, 60, 48, 36)
START, GOAL = camera_pose((0.0, 0.0, -1.0), 0.2, -0.1), camera_pose((1.0, 0.5, -1.2), -0.3, 0.1)
TASK = BenchTask("room", Path("room.glb"), START, GOAL, CAMERA)
LIMITS = VelocityLimits()
OPTIONS = FlightOptions(timeout_s=60.0)
SETTING = Setting("classical", (), LIMITS, 0, "abc", OPTIONS)


FLOWN = FlightRecord(
    task="room",
    difficulty="easy",
    matcher="classical",
    service=(),
    seed=0,
    start=tuple(START.ravel()),
    goal=tuple(GOAL.ravel()),
    size=(96, 72),
    overlap=0.5,
    limits=LIMITS,
    bound=TimeBound(4.0, 2.0),
    initial_translation_m=1.1,
    initial_rotation_deg=29.0,
    end_state="DONE",
    end_cause="goal reached",
    converged=True,
    final_translation_m=0.01,
    final_rotation_deg=0.2,
    servo_s=1.0,
    within_s=9.0,
    done_s=12.0,
    path_ratio=1.1,
    version="0.1.0",
    revision="abc",
)
LOST = replace(
    FLOWN,
    task="hall",
    end_state="NOT READY",
    end_cause="the goal is not in view",
    converged=False,
    **dict.fromkeys(
        ("final_translation_m", "final_rotation_deg", "servo_s", "within_s", "done_s", "path_ratio")
    ),
)


def track(*errors):
    return [TrackPoint(50_000_000 * k, np.eye(4), m, np.radians(deg)) for k, (m, deg) in errors]


def test_levelling_keeps_place_and_heading_and_takes_roll_and_pitch():
    tilted = START @ make_pose(so3_exp(np.array([0.0, 0.0, 0.4])), np.zeros(3))
    np.testing.assert_allclose(levelled(tilted), camera_pose((0.0, 0.0, -1.0), 0.2), atol=1e-12)


def test_a_camera_that_looks_straight_down_has_no_heading():
    with pytest.raises(GeometryError, match="-90 degrees"):
        levelled(camera_pose((0.0, 0.0, -1.0), 0.0, -np.pi / 2))


def test_the_turn_is_the_change_of_heading():
    level = levelled_task(TASK)
    assert turn_rad(level.T_world_start, level.T_world_goal) == pytest.approx(-0.5)
    east, west = (camera_pose((0, 0, 0), yaw) for yaw in (3.0, -3.0))
    assert turn_rad(east, west) == pytest.approx(2 * np.pi - 6.0)


def test_it_counts_as_within_only_once_it_stays_there():
    errors = [(0.5, 9), (0.04, 0.5), (0.06, 0.5), (0.04, 1.2), (0.04, 0.9), (0.01, 0.1)]
    points = track(*enumerate(errors))
    assert within_s(points, 0) == pytest.approx(0.2)
    assert within_s(points, -1_000_000_000) == pytest.approx(1.2)
    assert within_s(points[:4], 0) is None
    assert within_s([], 0) is None


def test_the_first_motion_is_when_the_gate_enters_servo_after_the_switch():
    states = [(1, "SERVO"), (5, "ENGAGE"), (1_000_000_005, "SERVO"), (2_000_000_005, "SERVO")]
    assert since(states, "SERVO", 5) == pytest.approx(1.0)
    assert since(states, "DONE", 5) is None


def test_the_limits_are_the_lower_of_the_law_s_and_the_gate_s():
    words = ("--set", "limits.horizontal_m_s=0.9", "--set", "servo.max_vertical_m_s=0.1")
    limits = velocity_limits(settings_in_force(words))
    assert limits.horizontal_m_s == 0.5  # the law's
    assert limits.vertical_m_s == 0.1
    assert limits.yaw_slew_rad_s2 == pytest.approx(LIMITS.yaw_slew_rad_s2)


def test_a_flight_by_another_depth_network_is_flown_again(tmp_path):
    task = task_on_disk(tmp_path)
    for name, depth in (("old", 0.5), ("new", 0.4)):
        write_bundle(tmp_path / name, bundle(np.full((24, 32), depth)))
    old = replace(SETTING, network=str(tmp_path / "old"))
    assert fits(fresh_record(task, old), task, old)
    assert not fits(fresh_record(task, old), task, replace(old, network=str(tmp_path / "new")))


def test_the_depth_network_of_a_flight_is_the_one_that_its_settings_need():
    settings = settings_in_force(("--set", "servo.depth=fused", "--set", "depth.model=own/depth"))
    assert depth_network(settings) == "own/depth"
    settings["servo"]["depth"] = "motion"
    assert depth_network(settings) is None


def test_ratios_are_over_the_slower_of_way_and_turn():
    assert (FLOWN.within_ratio, FLOWN.motion_ratio, FLOWN.done_ratio) == (2.25, 2.0, 3.0)
    assert replace(FLOWN, converged=False).within_ratio is None
    assert LOST.done_ratio is None


def test_a_record_comes_back_from_disk(tmp_path):
    for one in (FLOWN, LOST):
        write_record(tmp_path, one)
    assert read_records(tmp_path) == [LOST, FLOWN]
    record_path(tmp_path, "room").write_text("{}")
    with pytest.raises(ConfigError, match=r"room\.json"):
        read_records(tmp_path)


def test_a_summary_among_records_is_left_out_with_a_line(tmp_path, capfd):
    write_record(tmp_path, FLOWN)
    write_json(tmp_path / "drone.json", {"seed": 0, "methods": {"service": summarise([FLOWN])}})
    assert read_records(tmp_path) == [FLOWN]
    assert "drone.json is a summary" in capfd.readouterr().err


@pytest.mark.parametrize(
    "changes",
    [
        {"matcher": "dfvs-flow"},
        {"seed": 1},
        {"service": ("--set", "gate.response_s=0")},
        {"limits": VelocityLimits(horizontal_m_s=0.4)},
        {"options": replace(OPTIONS, timeout_s=10.0)},
        {"options": replace(OPTIONS, conditions=Conditions("medium"))},
        {"options": replace(OPTIONS, conditions=Conditions("perfect", "breeze"))},
    ],
)
def test_a_flight_with_other_settings_is_flown_again(tmp_path, changes):
    task = task_on_disk(tmp_path)
    kept = fresh_record(task)
    assert fits(kept, task, SETTING)
    assert not fits(kept, task, replace(SETTING, **changes))
    moved = replace(task, T_world_goal=camera_pose((1.0, 0.5, -1.3), -0.3, 0.1))
    assert not fits(kept, moved, SETTING)


def test_flights_of_another_autopilot_are_kept_apart(tmp_path):
    task, url = task_on_disk(tmp_path), "udpin://127.0.0.1:14540"
    kept = fresh_record(task, autopilot=url, estimate=None, wind=None)
    assert fits(kept, task, replace(SETTING, options=replace(OPTIONS, autopilot=url)))
    other = replace(OPTIONS, autopilot="udpin://127.0.0.1:14541")
    assert not fits(kept, task, replace(SETTING, options=other))
    assert not fits(kept, task, SETTING)
    write_record(tmp_path, kept)
    assert read_records(tmp_path) == [kept]


def test_a_flight_with_other_inputs_is_flown_again(tmp_path):
    task, config = task_on_disk(tmp_path), tmp_path / "service.toml"
    config.write_text("[servo]")
    setting = replace(SETTING, config=config)
    kept = fresh_record(task, setting)
    assert fits(kept, task, setting)
    assert not fits(kept, replace(task, camera=CameraModel(96, 72, 70, 70, 48, 36)), setting)
    config.write_text("[servo]\ngain_far = 1")
    os.utime(config, ns=(1, 1))
    assert not fits(kept, task, setting)
    task.scene.write_bytes(b"another room")
    os.utime(task.scene, ns=(1, 1))
    assert not fits(fresh_record(task_on_disk(tmp_path / "other")), task, SETTING)


def test_a_flight_that_never_began_is_tried_again(tmp_path):
    task = task_on_disk(tmp_path)
    assert not fits(fresh_record(task, end_state="NOT READY"), task, SETTING)


def task_on_disk(folder):
    folder.mkdir(exist_ok=True)
    (folder / "room.glb").write_bytes(b"a room")
    return replace(TASK, scene=folder / "room.glb")


def fresh_record(task, setting=SETTING, **changes):
    inputs = input_digest(task, setting.matcher, setting.config, setting.network)
    return replace(FLOWN, version=version("dfvs"), timeout_s=60.0, inputs=inputs, **changes)


def test_the_summary_is_honest_about_what_was_not_flown():
    summary = summarise([FLOWN, LOST])
    assert (summary["scenes"], summary["converged"]) == (2, 1)
    assert summary["mean_within_ratio"] == summary["worst_within_ratio"] == 2.25
    assert summary["per_scene"]["hall"]["end_cause"] == "the goal is not in view"
    assert summary_line(summary).startswith("1 of 2 converged; within 5 cm and 1° after 2.25 times")
    assert "NOT READY: the goal is not in view" in flight_line(LOST)
    assert summary_line(summarise([LOST])) == "0 of 1 converged"


def test_the_report_has_a_row_for_every_flight():
    text = drone_section([FLOWN, LOST])
    assert "0.5 m/s over ground, 0.3 m/s" in text
    assert "State estimate of the vehicle: perfect; wind:\ncalm." in text
    assert "<td>9.0 s<td>2.25<td>12.0 s<td>3.00<td>0.010 m<td>0.20°" in text
    assert "NOT READY: the goal is not in view" in text


def test_the_report_has_the_limits_of_every_flight():
    text = drone_section([FLOWN, replace(LOST, limits=VelocityLimits(horizontal_m_s=0.8))])
    assert "0.5 m/s over ground" in text
    assert "or, by the flight, 0.8 m/s over ground" in text


def test_the_report_says_what_was_flown_and_what_of_it_is_unknown():
    url = "udpin://127.0.0.1:14540"
    text = drone_section([FLOWN, replace(LOST, autopilot=url, estimate=None, wind=None)])
    assert f"in real time by the simulated vehicle, the autopilot on {url} through" in text
    assert "State estimate of the vehicle: perfect, unknown; wind:\ncalm, unknown." in text


def test_a_row_is_flat_and_names_version_seed_and_revision():
    values = row(FLOWN)
    assert all(not isinstance(value, dict | list | tuple) for value in values.values())
    assert {"version", "revision", "seed", "bound_s", "within_ratio"} <= set(values)
    assert set(row(LOST)) == set(values)
