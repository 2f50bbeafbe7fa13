"""Words of ``dfvs-bench`` that cannot be used: exit code 2, one line, and nothing is left."""

import json
import shlex

import numpy as np
import pytest

from dfvs_bench.cli import main
from dfvs_bench.trials.task import BenchTask, write_tasks
from dfvs_core.geometry.camera import CameraModel
from dfvs_sim.scene import builtin_room_path
from dfvs_sim.viewpoints.poses import camera_pose

POSE = camera_pose((0.5, -1.0, -1.3), 0.7)
TASK = BenchTask(
    "room", builtin_room_path(), POSE, POSE, CameraModel(160, 120, 100, 100, 80, 60), "easy"
)
PX4 = "udpin://127.0.0.1:14540"
BASIN = "--runs runs --method true-depth --bundle classical --iterations 40 --trials 2"
GIVEN = {
    "basin": f"--tasks tasks.json --translations 0.2,4 --rotations 4,4,8 {BASIN}",
    "drone": "--tasks tasks.json --runs runs --timeout 120 --ready 90",
    "flow": "wall.npz",
    "lockstep": "--seeds 0 --timeout 0.2",
    "relocalise": "ROOM",
    "table1": "--tasks tasks.json --runs runs --iterations 2 --bundle classical --methods sift",
}
"""Words before those of a row; a later one counts."""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """The working folder: a task, also with one whose scene is damaged, and pairs of images."""
    monkeypatch.chdir(tmp_path)
    write_tasks(tmp_path / "tasks.json", [TASK])
    (task,) = json.loads((tmp_path / "tasks.json").read_text())["tasks"]
    tasks = [task, task | {"name": "hall", "scene": "half.glb"}]
    (tmp_path / "damaged.json").write_text(json.dumps(tasks))
    room = builtin_room_path().read_bytes()
    (tmp_path / "half.glb").write_bytes(room[: len(room) // 2])
    images = np.zeros((1, 48, 64, 3), np.uint8)
    flow, vis = np.zeros((1, 48, 64, 2), np.float16), np.ones((1, 48, 64), bool)
    np.savez(
        tmp_path / "wall.npz", IA=images, IB=images, flow=flow, vis=vis, level=np.zeros(1, int)
    )
    return tmp_path


@pytest.mark.parametrize(
    ("command", "words", "said"),
    [
        ("basin", "--rotations 20,20", "three angles"),
        ("basin", "--translations near", "--translations is 'near'"),
        ("basin", "--translations 0", "translation is 0 m"),
        ("basin", "--trials 0", "--trials is 0"),
        ("basin", "--seed -1", "--seed is -1"),
        ("basin", "--plot basin.txt", ".png"),
        ("basin", "--method magic", "no method 'magic'"),
        ("basin", "--scenes moon", "no scene 'moon'"),
        ("basin", "--dask tcp://127.0.0.1:1 --workers 2", "--workers 2 beside --dask"),
        ("drone", "--set limits.speed=3", "unknown key 'limits.speed'"),
        ("drone", "--set flow.model=classical", "--bundle"),
        ("drone", "--timeout 0", "--timeout is 0"),
        ("drone", "--seed -1", "--seed is -1"),
        ("drone", f"--estimate low --autopilot {PX4}", "--estimate beside --autopilot"),
        ("drone", f"--wind calm --autopilot {PX4}", "--wind beside --autopilot"),
        ("drone", f"--ground {PX4}", "--ground without --autopilot"),
        ("drone", "--system-id 251", "--system-id is 251"),
        ("drone", "--scenes moon", "no scene 'moon'"),
        ("drone", "--scene moon.glb", "moon.glb is no GLB file"),
        ("flow", "--bundle raft", "no model 'raft'; expected 'classical' or the folder"),
        ("flow", "--threads 0", "--threads is 0; expected 1 to 64"),
        ("flow", "--json .", "--json . is a folder"),
        ("flow", "--json none/flow.json", "lies in no folder"),
        ("lockstep", "--seeds a-3", "--seeds is 'a-3'"),
        ("lockstep", "--seeds 9-3", "--seeds is '9-3'"),
        ("lockstep", "--json none/f.json", "--json none/f.json lies in no folder"),
        ("lockstep", "--json .", "--json . is a folder; expected a file in it"),
        ("lockstep", "--plot none/f.png", "--plot none/f.png lies in no folder"),
        ("lockstep", "--plot f.txt", "--plot is 'f.txt'; expected a name that ends in .png"),
        ("lockstep", "--hold 0", "--hold is 0"),
        ("lockstep", "--timeout 4000", "--timeout is 4000"),
        ("lockstep", "--speed -1", "--speed is -1"),
        ("lockstep", "--slew 6", "--slew is 6"),
        ("relocalise", "nowhere.glb", "scene nowhere.glb cannot be read (No such file or "),
        ("relocalise", "--trials 0", "--trials is 0"),
        ("relocalise", "--threads 0", "--threads is 0"),
        ("relocalise", "--working-width 9", "--working-width is 9; expected 64 to 1920"),
        ("relocalise", "--seed -1", "--seed is -1"),
        ("relocalise", "--camera big", "--camera is 'big'"),
        ("relocalise", "--bundle none", "there is no model 'none'"),
        ("relocalise", "--without sleep", "there is no stage 'sleep'; expected one of turns, "),
        ("relocalise", "ROOM", "names of their own"),
        ("relocalise", "--json nowhere/f.json", "lies in no folder"),
        ("renderer", "--json none/f.json", "lies in no folder"),
        ("renderer", "--seed -1", "--seed is -1"),
        ("report", "--runs none --basin none --drone none --out r.html", "hold no trials"),
        ("report", "--out nowhere/r.html", "--out nowhere/r.html lies in no folder"),
        ("report", "--out r.txt", "--out is 'r.txt'; expected a name that ends in .html"),
        ("scenes", "--setting near --out near --share 1.5", "--share is 1.5"),
        ("table1", "--csv .", "--csv . is a folder"),
        ("table1", "--methods magic", "true-depth"),
        ("table1", "--scenes moon", "moon"),
        ("table1", "--tasks damaged.json", "half.glb"),
        ("table1", "--perturb fog", "there is no perturbation 'fog'"),
        ("table1", "--methods fused-depth --depth-bundle nowhere", "there is no model"),
        ("table1", "--methods saxena --saxena-bundle nowhere", "there is no model 'nowhere'"),
    ],
)
def test_words_that_cannot_be_used_are_one_clear_line(folder, refused, command, words, said):
    before = sorted(folder.iterdir())
    given = [command, *shlex.split(GIVEN.get(command, "")), *shlex.split(words)]
    room = str(builtin_room_path())
    assert said in refused(main, *(room if word == "ROOM" else word for word in given))
    assert sorted(folder.iterdir()) == before
