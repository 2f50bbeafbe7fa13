"""Flow of the Siamese network that regresses poses, on descriptors whose motion is known."""

import numpy as np
import pytest
import torch

from dfvs_export.networks.pose_regression import STRIDE, Flow
from dfvs_export.networks.siamese_pose import SiameseNet
from dfvs_export.training.drawn_flows import drawn_flows
from dfvs_export.training.pose_loss import _flow_loss, _local_loss, _match_loss

STEP = (2, -1)  # cells to the right and down


@pytest.fixture(scope="module")
def network():
    torch.manual_seed(0)
    network = SiameseNet().eval()
    torch.nn.init.zeros_(network.smooth_head.bias)
    network.sharpness_8.data.fill_(5.0)
    network.sharpness_4.data.fill_(5.0)
    return network


def descriptors(channels, rows, columns, step=STEP):
    """Those of a pair of images of which the second one shows all of the first one a step away."""
    first = torch.randn(1, channels, rows, columns, generator=torch.Generator().manual_seed(1))
    return torch.cat([first, first.roll((step[1], step[0]), dims=(2, 3))])


def within(flow):
    """Flow that is not known at the border, whose cells lead out of the view."""
    known = torch.full_like(flow, np.nan)
    known[..., 3:-3, 3:-3] = flow[..., 3:-3, 3:-3]
    return known


def inner(flow, columns):
    """Flow of cells away from the border, in cells."""
    return (flow * columns)[0, :, 8:-8, 8:-8]


def truth(rows, columns, step=STEP):
    """Flow by so many cells everywhere."""
    return (torch.tensor(step) / columns).reshape(1, 2, 1, 1).expand(-1, -1, rows, columns)


def test_the_first_flow_leads_to_the_cells_that_are_alike(network):
    coarse = descriptors(64, 18, 24)
    with torch.no_grad():
        similarity = network.similarity(coarse)
        found = network.first_flow(coarse, similarity)
    assert (inner(found.flow, 24) - torch.tensor(STEP).reshape(2, 1, 1)).abs().max() < 1e-2
    right, wrong = (_match_loss(similarity, within(truth(18, 24, step))) for step in (STEP, (0, 0)))
    assert right < 0.1 < 5.0 < wrong


def test_a_refinement_finds_what_is_missing_of_the_flow(network):
    """Of a step of (2, -1) cells, (1, 1) are known."""
    fine = descriptors(48, 36, 48)
    so_far = Flow(truth(36, 48, (1.0, 1.0)), torch.zeros(1, 1, 36, 48))
    with torch.no_grad():
        found, alike = network.refined(fine, so_far)
    assert (inner(found.flow, 48) - torch.tensor(STEP).reshape(2, 1, 1)).abs().max() < 2e-2
    right, wrong = (
        _local_loss(alike, within(truth(36, 48, step) - so_far.flow)) for step in (STEP, (0, 0))
    )
    assert right < 0.1 < 5.0 < wrong


def test_what_cannot_be_reached_or_is_not_known_is_not_learnt():
    alike = torch.randn(1, 49, 36, 48, generator=torch.Generator().manual_seed(2))
    assert _local_loss(alike, truth(36, 48, (9, 0))) == 0.0
    unknown = torch.full((1, 2, 36, 48), np.nan)
    assert _local_loss(alike, unknown) == 0.0
    assert _flow_loss(Flow(truth(36, 48), torch.zeros(1, 1, 36, 48)), unknown) == 0.0


def test_drawn_flows_err_as_they_say():
    flow, focal, (translation, rotation) = drawn_flows(64, np.random.default_rng(3))
    again, *_ = drawn_flows(64, np.random.default_rng(3))
    assert torch.equal(flow.flow, again.flow)
    assert flow.flow.shape == (64, 2, 144 // STRIDE, 192 // STRIDE)
    assert (focal.shape, translation.shape, rotation.shape) == ((64, 1), (64, 3), (64, 3))
    # What a turn and a shift alike do to the middle of the view, to first order.
    turn = torch.stack([-rotation[:, 1], rotation[:, 0]], 1)
    middle = focal * (turn - translation[:, :2])
    apart = (flow.flow[:, :, 8:10, 11:13].mean((2, 3)) - middle).abs().mean(1)
    spread = flow.spread[:, 0, 8:10, 11:13].exp().mean((1, 2))
    sure = spread < spread.median()
    assert apart[sure].mean() < 0.02 < middle[sure].abs().mean()
    assert apart[sure].mean() < apart[~sure].mean()
