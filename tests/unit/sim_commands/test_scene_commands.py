import json
import sys

import numpy as np
import pytest
from built_in_room import built_in_room
from subcommand import run_subcommand

from dfvs_bench.commands import renderer
from dfvs_core.errors import DfvsError
from dfvs_core.messages.goal import GoalSidecar
from dfvs_core.messages.image import decode_image
from dfvs_rooms.commands import room
from dfvs_sim.commands import goal
from dfvs_sim.scene.frames import ned_from_gltf
from dfvs_sim.scene.glb import load_glb
from dfvs_sim.viewpoints.poses import camera_pose


def goal_sidecar(folder, *words):
    """Sidecar that is written beside goal.png."""
    assert run_subcommand(goal, *words, "--out", folder / "goal.png") == 0
    return GoalSidecar.from_json((folder / "goal.json").read_text())


class TestGoal:
    def test_writes_what_the_camera_sees_and_how_it_stood(self, tmp_path):
        words = ["--pose", "0.5,-1,-1.3,40", "--size", "160x120", "--fov", "60"]
        sidecar = goal_sidecar(tmp_path, *words)
        assert sidecar.camera.size == (160, 120)
        assert sidecar.camera.fx == pytest.approx(80 / np.tan(np.radians(30)))
        assert (sidecar.roll_rad, sidecar.pitch_rad) == pytest.approx((0, 0), abs=1e-12)
        pose = np.array(sidecar.pose_camera).reshape(4, 4)
        np.testing.assert_allclose(pose, camera_pose((0.5, -1.0, -1.3), np.radians(40)))
        expected = built_in_room().render(sidecar.camera, pose).image
        np.testing.assert_array_equal(decode_image((tmp_path / "goal.png").read_bytes()), expected)
        assert sorted(p.name for p in tmp_path.iterdir()) == ["goal.json", "goal.png"]

    def test_takes_points_in_the_axes_of_the_file(self, tmp_path):
        # file (-1, 1.3, -0.5) is 0.5 m north, 1 m west, 1.3 m up; the target is south-east of it
        words = ["--eye=-1,1.3,-0.5", "--look-at", "0,1.3,0.5", "--size", "64x48"]
        sidecar = goal_sidecar(tmp_path, *words)
        pose = np.array(sidecar.pose_camera).reshape(4, 4)
        np.testing.assert_allclose(
            pose, camera_pose((0.5, -1.0, -1.3), np.radians(135)), atol=1e-12
        )

    def test_notes_the_pitch_of_a_view_that_looks_down(self, tmp_path):
        words = ["--eye", "0,1.5,0", "--look-at", "0,0.5,-1", "--size", "64x48"]
        assert goal_sidecar(tmp_path, *words).pitch_rad == pytest.approx(-np.pi / 4)

    @pytest.mark.parametrize(
        ("words", "match"),
        [
            ([], "either --pose, or --eye together with --look-at"),
            (["--pose", "0,0,-1,0", "--eye", "0,1,0"], "either --pose"),
            (["--eye", "0,1,0"], "--look-at is missing"),
            (["--pose", "0,0,-1"], "X,Y,Z,YAW"),
            (["--eye", "0,1,nan", "--look-at", "0,1,1"], "--eye is '0,1,nan'"),
            (["--pose", "0,0,-900,0"], "sees nothing"),
            (["--pose", "0,0,-1,0", "--scene", "none.glb"], "none.glb cannot be read"),
            (["--pose", "0,0,-1,0", "--size", "10000"], "--size"),
            (["--pose", "0,0,-1,0", "--out", "goal.jpg"], r"ends in \.png"),
            (["--scene", "none.glb", "--out", "none/goal.png"], "lies in no folder"),
        ],
    )
    def test_says_what_is_wrong(self, tmp_path, words, match):
        with pytest.raises(DfvsError, match=match):
            run_subcommand(goal, "--out", str(tmp_path / "goal.png"), *words)
        assert not list(tmp_path.iterdir())


class TestBenchRenderer:
    def test_prints_and_writes_the_time_of_every_kind(self, tmp_path, capsys):
        out = tmp_path / "times.json"
        assert run_subcommand(renderer, "--frames", "3", "--json", str(out)) == 0
        rows = json.loads(out.read_text())["results"]
        kinds = {(row["width"], row["height"], row["antialias"]) for row in rows}
        assert len(kinds) == 4
        assert all(0 < row["median_ms"] <= row["p99_ms"] for row in rows)
        assert "640 x 480" in capsys.readouterr().out

    def test_wants_frames_to_time(self):
        with pytest.raises(DfvsError, match="--frames is 1"):
            run_subcommand(renderer, "--frames", "1")


class TestRoom:
    def test_draws_an_interior_and_lights_it_without_mitsuba(self, tmp_path, monkeypatch):
        monkeypatch.setitem(sys.modules, "mitsuba", None)
        out = tmp_path / "hallway.glb"
        words = ["--kind", "corridor", "--light", "quick", "--seed", "5", "--out", str(out)]
        assert run_subcommand(room, *words, "--preview", str(tmp_path / "hallway.png")) == 0
        told = json.loads((tmp_path / "hallway.json").read_text())
        assert (told["kind"], told["light"], told["samples"]) == ("corridor", "quick", None)
        scene = load_glb(out)
        low, high = scene.bounds
        size = told["size_m"]
        np.testing.assert_allclose(
            high - low, [size["north_south"], size["east_west"], size["height"]], atol=0.01
        )
        assert 6.0 <= size["east_west"] <= 10.0
        preview = decode_image((tmp_path / "hallway.png").read_bytes())
        assert 20 < preview.mean() < 235
        for view in told["views"].values():
            eye = ned_from_gltf(view["eye_gltf_m"])
            assert (low < eye).all()
            assert (eye < high).all()

    def test_without_mitsuba_says_how_to_get_it(self, tmp_path, monkeypatch):
        monkeypatch.setitem(sys.modules, "mitsuba", None)
        with pytest.raises(DfvsError, match=r"pip install 'dfvs-lab\[bake\]'"):
            run_subcommand(room, "--seed", "1", "--out", str(tmp_path / "room.glb"))

    @pytest.mark.parametrize(
        ("words", "match"),
        [
            (["--seed", "1", "--out", "room.obj"], r"ends in \.glb"),
            (["--seed", "-1", "--out", "room.glb"], "--seed is -1"),
            (["--seed", "1", "--out", "none/room.glb"], "lies in no folder"),
            (["--seed", "1", "--out", "made.glb"], "--out made.glb is a folder"),
            (["--seed", "1", "--out", "room.glb", "--samples", "0"], "0 light paths"),
        ],
    )
    def test_says_what_is_wrong_before_the_work(self, tmp_path, monkeypatch, words, match):
        monkeypatch.chdir(tmp_path)
        (tmp_path / "made.glb").mkdir()
        with pytest.raises(DfvsError, match=match):
            run_subcommand(room, *words)
