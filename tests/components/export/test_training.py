"""Training of dfvs-flow on a handful of pairs of a room, and what all trainings share."""

import shlex
from operator import attrgetter

import numpy as np
import pytest
import torch

from dfvs_core.errors import ConfigError
from dfvs_core.geometry.poses import make_pose, so3_exp
from dfvs_export.cli import main
from dfvs_export.networks.pose_regression import SIZE as POSE_SIZE
from dfvs_export.training.depth_views import DepthViewReader
from dfvs_export.training.planar_pairs import PlanarPoseReader
from dfvs_export.training.pose_pairs import RoomPoseReader
from dfvs_export.training.room_pairs import SIZE, PairReader, TrainingPair, View, true_matches
from dfvs_export.weights.flow import load_weights

VIEW, POSE_VIEW = SIZE[::-1], POSE_SIZE[::-1]
POSE_PAIR = attrgetter("first", "second", "flow", "T_first_second", "focal")
STILL = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])


def test_true_matches_are_found_by_depth_and_pose():
    """A wall 2 m away, seen by a camera that moves 0.1 m to the right and rolls."""
    wall = np.full((SIZE[1] // 2, SIZE[0] // 2), 2.0, np.float32)
    blank = np.zeros(SIZE[::-1], np.float32)
    K = np.array([400.0, 400.0, 320.0, 240.0])
    T = make_pose(so3_exp(np.array([0.0, 0.0, 0.2])), [0.1, 0.0, 0.0])
    pair = TrainingPair(View(blank, STILL, wall), View(blank, STILL, wall), T, K)
    second = np.random.default_rng(0).uniform((200, 150), (440, 330), (30, 2)).round()
    rays = np.column_stack([(second + 0.5 - K[2:]) / K[:2], np.ones(30)]) * 2.0
    seen = rays @ T[:3, :3].T + T[:3, 3]
    first = seen[:, :2] / seen[:, 2:] * K[:2] + K[2:] - 0.5
    order = np.random.default_rng(1).permutation(30)
    alone = np.array([[20.0, 20.0]])
    truth = true_matches(pair, np.concatenate([first[order], alone]), second)
    assert len(truth.first) >= 28  # others lie within 3 px of each other
    np.testing.assert_array_equal(order[truth.first], truth.second)
    assert truth.first_unmatchable[-1]
    assert not truth.first_unmatchable[truth.first].any()


@pytest.mark.parametrize(
    ("reader", "parts", "shapes", "values"),
    [
        (PairReader, attrgetter("first.image", "second.image"), (VIEW, VIEW), (-1.0, 255.0)),
        (DepthViewReader, attrgetter("image", "depth_m"), ((240, 320), (120, 160)), (0.0, 1.0)),
        (RoomPoseReader, POSE_PAIR, (POSE_VIEW, POSE_VIEW), (-1.0, 1.0)),
        (PlanarPoseReader, POSE_PAIR, (POSE_VIEW, POSE_VIEW), (-1.0, 1.0)),
    ],
)
def test_what_is_learnt_from_is_drawn_by_the_seed(folder, reader, parts, shapes, values):
    first, again, other = (parts(reader(folder, seed).draw()) for seed in (1, 1, 2))
    for drawn, repeated in zip(first, again, strict=True):
        np.testing.assert_array_equal(drawn, repeated)
    assert not np.array_equal(first[0], other[0])
    assert (first[0].shape, first[1].shape) == shapes
    for image in (part for part in first if np.shape(part) == shapes[0]):
        assert values[0] <= image.min() < image.max() <= values[1]


@pytest.mark.parametrize("reader", [PairReader, DepthViewReader, RoomPoseReader, PlanarPoseReader])
@pytest.mark.parametrize("arrays", [{"T": np.zeros((0, 4, 4))}, {}], ids=["no pair", "no poses"])
def test_a_room_without_a_pair_is_named(tmp_path, reader, arrays):
    np.savez(tmp_path / "30007.npz", **arrays)
    with pytest.raises(ConfigError, match=r"30007\.npz holds no pairs"):
        reader(tmp_path, 1).draw()


def test_a_short_training_changes_the_matcher_and_leaves_the_encoder(trained, tmp_path):
    out = tmp_path / "matcher.pt"
    told = trained("train", "--learning-rate", "1e-3", "--keypoints", "256", "--out", out)
    before, after = load_weights(None), load_weights(out)
    assert all(torch.equal(before.encoder[name], after.encoder[name]) for name in before.encoder)
    same = [torch.equal(value, after.matcher[name]) for name, value in before.matcher.items()]
    assert np.mean(same) < 0.2
    assert "8 wide-baseline pairs" in after.training
    assert "8 pairs: loss" in told
    assert after.digest != before.digest


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("train --pairs PAIRS --out x.pt --minutes 0", "minutes is 0.0"),
        ("train --pairs PAIRS --out none/there.pt", "lies in no folder"),
        ("train --pairs PAIRS --out ..", "--out .. is a folder"),
        ("train --pairs empty --out x.pt", "no pairs in"),
        ("train-depth --from f.pt --pairs PAIRS --out x.pt --minutes 0", "minutes is 0.0"),
        ("train-depth --from f.pt --pairs PAIRS --out x.pt --threads -1", "threads is -1"),
        ("train-pose --network saxena --pairs . --out x.pt --minutes 0", "minutes is 0.0"),
        ("train-pose --network saxena --pairs . --out x.pt --seed -1", "--seed is -1"),
        ("train-pose --network bateux --pairs . --out x.pt", "--from CHECK"),
        ("pose --checkpoint nowhere.pt --out b", "no weights at nowhere.pt"),
    ],
)
def test_what_cannot_be_done_is_refused_in_one_line(
    folder, tmp_path, monkeypatch, refused, words, said
):
    monkeypatch.chdir(tmp_path)
    assert said in refused(main, *shlex.split(words.replace("PAIRS", str(folder))))
    assert not list(tmp_path.iterdir())
