"""Flow of the network on stacked images, and what its pose is learnt from."""

import numpy as np
import pytest
import torch
from torch.nn import functional

from dfvs_export.networks.stacked_pose import LEVELS, StackedNet
from dfvs_export.training.drawn_flows import with_errors
from dfvs_export.training.pose_pairs import RoomPoseReader


class Told(torch.nn.Module):
    """A level that finds always the same change, and keeps what it was shown."""

    def __init__(self, step):
        super().__init__()
        self.step, self.seen = torch.tensor([*step, 0.5]).reshape(1, 3, 1, 1), None

    def forward(self, seen):
        self.seen = seen
        return self.step.expand(-1, -1, *seen.shape[2:])


@pytest.fixture(scope="module")
def images():
    """A view and the same moved by 16 px to the right and 8 px down."""
    coarse = torch.randn(1, 1, 18, 24, generator=torch.Generator().manual_seed(0))
    first = functional.interpolate(coarse, (144, 192), mode="bicubic")
    return first, first.roll((8, 16), dims=(2, 3))


def test_a_level_sees_the_second_image_as_the_levels_before_have_moved_it(images):
    network = StackedNet()
    network.levels = torch.nn.ModuleList([Told((1.0, 0.5)), Told((0.0, 0.0)), Told((-1.0, 0.0))])
    flows = network.flows(*images)
    for flow, stride, px in zip(flows, LEVELS, ((16, 8), (16, 8), (12, 8)), strict=True):
        assert flow.flow.shape == (1, 2, 144 // stride, 192 // stride)
        expected = torch.tensor(px).reshape(1, 2, 1, 1) / 192
        assert (flow.flow - expected).abs().max() < 1e-6
    assert [float(flow.spread.mean()) for flow in flows] == pytest.approx([-2.5, -2.0, -1.5])
    first, moved, inside = network.levels[1].seen[:, :3].unbind(1)
    away = np.s_[:, 5:-5, 5:-7]
    assert (first - moved)[away].abs().max() < 1e-3 < (first - moved).abs().max()
    assert inside[:, :-1, :-2].all()
    assert not inside[:, :, -2:].any()


def test_an_untrained_network_finds_no_motion(images):
    with torch.no_grad():
        assert all(not flow.flow.any() for flow in StackedNet().flows(*images))


def test_flow_that_is_not_known_is_wrong_and_says_so():
    true = torch.zeros(64, 2, 18, 24)
    true[:, :, :, 12:] = np.nan
    flow = with_errors(true, np.random.default_rng(1))
    assert flow.flow.isfinite().all()
    known, unknown = flow.flow[..., :12].abs(), flow.flow[..., 12:].abs()
    assert known.median() < 0.3 * unknown.median()
    assert flow.spread[..., :12].mean() < flow.spread[..., 12:].mean() - 1.0


def test_motions_between_views_of_rooms_are_small_against_their_depth(folder):
    reader = RoomPoseReader(folder, 3)
    lengths = [np.linalg.norm(reader.draw().T_first_second[:3, 3]) for _ in range(40)]
    assert 0.004 < min(lengths) < 0.05 < max(lengths) < 0.5
