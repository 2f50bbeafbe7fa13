"""Training of the networks that regress poses, on a handful of views of the built-in room."""

import cv2
import numpy as np
import pytest
import torch

from dfvs_core.errors import ConfigError
from dfvs_core.geometry.camera import CameraModel
from dfvs_export.cli import main
from dfvs_export.networks.pose_regression import SIZE
from dfvs_export.training import planar_pairs
from dfvs_export.training.planar_pairs import PlanarPoseReader, cluster, light
from dfvs_export.training.pose_pairs import STRIDE, RoomPoseReader, rays
from dfvs_export.weights.pose import NETWORKS, TrainedPose, load_pose_weights, starting_weights
from dfvs_models.bundle import read_bundle
from dfvs_models.catalog import load_pose

READERS = pytest.mark.parametrize("reader", [RoomPoseReader, PlanarPoseReader])


@pytest.fixture(scope="module")
def checkpoints(tmp_path_factory):
    """Drawn weights of both networks, the heads such that they give something."""
    folder, paths = tmp_path_factory.mktemp("weights"), {}
    for name, make in NETWORKS.items():
        torch.manual_seed(1)
        network = make()
        torch.nn.init.normal_(network.head[-1].weight, std=0.1)
        paths[name] = folder / f"{name}.pt"
        TrainedPose(name, network.state_dict(), "drawn weights", "None.").save(paths[name])
    return paths


def camera_of(pair):
    f = pair.focal * SIZE[0]
    return CameraModel(*SIZE, f, f, SIZE[0] / 2, SIZE[1] / 2)


@READERS
def test_the_flow_is_that_of_points_which_the_pose_moves(folder, reader):
    """There is a positive depth for every cell at which the pose gives the flow."""
    drawn = reader(folder, 5)
    for pair in [drawn.draw() for _ in range(12)]:
        camera, T = camera_of(pair), pair.T_first_second
        d = rays(camera)[STRIDE // 2 :: STRIDE, STRIDE // 2 :: STRIDE]
        there = camera.normalise(camera.grid(STRIDE) + pair.flow * camera.width)
        far, near = d @ T[:3, :3], -T[:3, 3] @ T[:3, :3]
        # z (far - xy far_z) + (near - xy near_z) = 0 in both coordinates: the epipolar line
        a = far[..., :2] - there * far[..., 2:]
        b = near[:2] - there * near[2]
        apart = np.abs(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])
        size = np.linalg.norm(a, axis=2) * np.linalg.norm(b, axis=2) + 1e-3
        known = np.isfinite(pair.flow).all(axis=2) & (np.abs(pair.flow) < 1.9).all(axis=2)
        assert (apart[known] < 2e-3 * size[known] + 1e-5).all()


@READERS
def test_the_flow_leads_to_the_same_things(folder, reader, monkeypatch):
    """What the second view shows where the flow leads looks like the first one, cell by cell."""
    monkeypatch.setattr(planar_pairs, "_LIT", 0.0)
    monkeypatch.setattr(planar_pairs, "_OCCLUDED", 0.0)
    drawn, alike = reader(folder, 6), []
    cells = np.s_[STRIDE // 2 :: STRIDE, STRIDE // 2 :: STRIDE]
    for pair in [drawn.draw() for _ in range(30)]:
        views = [cv2.GaussianBlur(view, (0, 0), 2.0) for view in pair[:2]]
        shown = [cv2.erode((v != 0).astype(np.float32), np.ones((9, 9))) for v in pair[:2]]
        there = (camera_of(pair).grid(STRIDE) + pair.flow * SIZE[0] - 0.5).astype(np.float32)
        u, v = np.moveaxis(np.nan_to_num(there, nan=-1.0), 2, 0)
        found, inside = (cv2.remap(x, u, v, cv2.INTER_LINEAR) for x in (views[1], shown[1]))
        known = (inside == 1.0) & (shown[0][cells] == 1.0)
        if known.sum() >= 400:
            alike.append(np.corrcoef(views[0][cells][known], found[known])[0, 1])
    assert len(alike) >= 10
    assert np.median(alike) > 0.85


def test_light_and_occlusion_change_what_they_should():
    rng = np.random.default_rng(0)
    assert cluster(0.3, rng).mean() == pytest.approx(0.3, abs=0.01)
    factors = [light(rng) for _ in range(20)]
    assert min(f.min() for f in factors) < 0.8
    assert max(f.max() for f in factors) > 1.2


@pytest.mark.parametrize("name", NETWORKS)
def test_a_short_training_goes_on_from_a_checkpoint(trained, checkpoints, tmp_path, name):
    out = tmp_path / "trained.pt"
    words = ("--network", name, "--from", checkpoints[name], "--out", out)
    told = trained("train-pose", *words)
    before, after = (load_pose_weights(path) for path in (checkpoints[name], out))
    changed = {k for k, v in before.state.items() if not torch.equal(v, after.state[k])}
    assert any(key.startswith("head") for key in changed)
    assert not any(key.startswith(("encoder._conv_stem", "encoder._blocks.0")) for key in changed)
    assert not any(key.startswith("encoder") and "running" in key for key in changed)
    assert after.training.startswith("None. Then: 16 pairs of views")
    assert "16 pairs: off by" in told
    with pytest.raises(ConfigError, match=f"holds weights of {name}"):
        starting_weights(next(other for other in NETWORKS if other != name), out)


@pytest.mark.parametrize("name", NETWORKS)
def test_a_checkpoint_becomes_a_bundle_that_gives_what_torch_gives(
    checkpoints, tmp_path, name, told
):
    out = tmp_path / "bundle"
    assert main(["pose", "--checkpoint", str(checkpoints[name]), "--out", str(out)]) == 0
    manifest = read_bundle(out).manifest
    assert (manifest.kind, manifest.name) == ("pose", name)
    network, torch_network = load_pose(str(out), 1), load_pose_weights(checkpoints[name]).network()
    rng = np.random.default_rng(2)
    images = rng.integers(0, 255, (2, SIZE[1], SIZE[0]), dtype=np.uint8)
    camera = CameraModel.from_horizontal_fov(*SIZE, 1.2)
    T = network.relative_pose(*(network.fit(np.dstack([i] * 3), camera) for i in images))
    tensors = (torch.from_numpy(i[None, None].astype(np.float32) / 127.5 - 1.0) for i in images)
    with torch.no_grad():
        wanted = torch_network(*tensors, torch.tensor([[camera.fx / SIZE[0]]]).float())
    np.testing.assert_allclose(T[:3, 3], wanted.translation[0].numpy(), atol=1e-3)
    report = told("check", out, "--count", 1, "--checkpoint", checkpoints[name])
    assert 0.0 < report["greatest_difference"] <= 1e-3
