"""Training of dfvs-flow on a handful of pairs of the built-in room."""

import numpy as np
import pytest

pytest.importorskip("torch")

import torch

from dfvs_core.errors import ConfigError
from dfvs_core.geometry.poses import make_pose, so3_exp
from dfvs_export.training.flow import FlowTrainSettings, train
from dfvs_export.training.room_pairs import (
    SIZE,
    PairReader,
    RoomFolder,
    TrainingPair,
    View,
    true_matches,
)
from dfvs_export.weights.flow import load_weights

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


def test_pairs_are_drawn_by_the_seed_and_augmented(folder):
    first, again, other = (PairReader(RoomFolder(folder), seed).draw() for seed in (1, 1, 2))
    np.testing.assert_array_equal(first.second.image, again.second.image)
    assert not np.array_equal(first.first.image, other.first.image)
    for view in (first.first, first.second):
        assert view.image.shape == SIZE[::-1]
        assert view.image.max() <= 255.0


def test_a_short_training_changes_the_matcher_and_leaves_the_encoder(folder, tmp_path):
    out, said = tmp_path / "matcher.pt", []
    threads = torch.get_num_threads()
    try:
        settings = FlowTrainSettings(
            pairs=folder,
            out=out,
            start=None,
            minutes=0.001,
            learning_rate=1e-3,
            encoder_blocks=0,
            keypoints=256,
            seed=0,
            threads=1,
        )
        train(settings, said.append)
    finally:
        torch.set_num_threads(threads)
    before, after = load_weights(None), load_weights(out)
    assert all(torch.equal(before.encoder[name], after.encoder[name]) for name in before.encoder)
    same = [torch.equal(value, after.matcher[name]) for name, value in before.matcher.items()]
    assert np.mean(same) < 0.2
    assert "8 wide-baseline pairs" in after.training
    assert after.digest != before.digest


@pytest.mark.parametrize(
    ("change", "match"),
    [
        ({"minutes": 0.0}, "minutes is 0.0"),
        ({"out": "none/there.pt"}, "lies in no folder"),
        ({"pairs": "empty"}, "no pairs in"),
    ],
)
def test_what_cannot_be_trained_is_refused(folder, tmp_path, change, match):
    given = {"pairs": folder, "out": tmp_path / "x.pt", "start": None, "minutes": 1.0}
    given |= {k: tmp_path / v if isinstance(v, str) else v for k, v in change.items()}
    given |= {"learning_rate": 1e-4, "encoder_blocks": 0, "keypoints": 256, "seed": 0, "threads": 1}
    with pytest.raises(ConfigError, match=match):
        train(FlowTrainSettings(**given), print)
    assert not list(tmp_path.iterdir())
