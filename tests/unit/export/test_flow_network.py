from __future__ import annotations

import pytest

torch = pytest.importorskip("torch")

from dfvs_export.networks.dfvs_flow import DfvsFlow, best_cells  # noqa: E402
from dfvs_export.networks.least_squares import spread_affine  # noqa: E402
from dfvs_export.networks.sampling import (  # noqa: E402
    cell_centres,
    chained,
    convex_upsample,
    local_correlation,
)
from dfvs_export.train.loss import (  # noqa: E402
    Truth,
    before_warp,
    flow_loss,
    look_loss,
    matching_loss,
)


@pytest.fixture(scope="module")
def network():
    torch.manual_seed(0)
    return DfvsFlow().eval()


def affine_flow(centres: torch.Tensor) -> torch.Tensor:
    """A zoom with a turn, up to some 80 px."""
    matrix = torch.tensor([[0.1, 0.3], [-0.3, 0.2]])
    return torch.einsum("ij,njhw->nihw", matrix, centres - 100.0)


@pytest.mark.parametrize(("width", "height"), [(64, 64), (96, 80)])
def test_any_multiple_of_16_gives_flow_of_the_full_size(network, width: int, height: int) -> None:
    with torch.no_grad():
        first, second = (network.encode(torch.rand(1, 3, height, width)) for _ in range(2))
        match = network.match(first, second)
    assert match.flow.shape == (1, 2, height, width)
    assert match.confidence().shape == (1, 1, height // 4, width // 4)
    assert torch.isfinite(match.flow).all()


def test_exposure_changes_features_little(network) -> None:
    image = 0.2 + 0.3 * torch.rand(1, 3, 64, 64)
    with torch.no_grad():
        one, other = network.encode(image), network.encode(1.5 * image)
    difference = (one.at8 - other.at8).norm() / one.at8.norm()
    assert float(difference) < 0.1


def test_affine_flow_is_carried_from_a_few_sure_cells_to_all() -> None:
    torch.manual_seed(0)
    centres = cell_centres(torch.zeros(1, 1, 30, 40), 8)
    truth = affine_flow(centres)
    weight = (torch.rand(1, 1, 30, 40) < 0.1).float()
    found = torch.where(weight > 0, truth, 50.0 * torch.randn_like(truth))
    spread = spread_affine(found, 0.9 * weight, centres)
    # the ridges leave a remainder of well under a pixel of up to 84
    assert float((spread - truth).norm(dim=1).mean()) < 0.2


def test_a_tenth_of_false_matches_does_not_bend_the_spread_flow() -> None:
    torch.manual_seed(0)
    centres = cell_centres(torch.zeros(1, 1, 30, 40), 8)
    truth = affine_flow(centres)
    false = torch.rand(1, 1, 30, 40) < 0.1
    found = torch.where(false, 120.0 * torch.randn_like(truth), truth)
    spread = spread_affine(found, torch.full((1, 1, 30, 40), 0.8), centres)
    assert float((spread - truth).norm(dim=1).median()) < 1.5


def test_two_planes_keep_their_own_motions() -> None:
    torch.manual_seed(0)
    centres = cell_centres(torch.zeros(1, 1, 30, 40), 8)
    left = (centres[:, :1] < 160.0).float()
    motions = torch.tensor([[12.0, 0.0], [-8.0, 4.0]]).reshape(2, 1, 2, 1, 1)
    truth = left * motions[0] + (1.0 - left) * motions[1]
    weight = (torch.rand(1, 1, 30, 40) < 0.3).float()
    spread = spread_affine(torch.where(weight > 0, truth, 0.0 * truth), weight, centres)
    error = (spread - truth).norm(dim=1)[0]
    # one affine motion for both would be off by some 5 px; the seam itself may blur
    assert float(error[:, :16].mean()) < 1.0
    assert float(error[:, 24:].mean()) < 1.0


def test_the_best_cell_is_found_to_a_fraction_of_a_cell() -> None:
    centres = cell_centres(torch.zeros(1, 1, 6, 8), 8)
    index = torch.arange(48)
    similarity = torch.zeros(1, 48, 48)
    similarity[0, index[:-1], index[1:]] = 20.0  # each cell matches its right neighbour
    flow, sure = best_cells(similarity, centres)
    assert flow[0, :, 2, 3].tolist() == pytest.approx([8.0, 0.0], abs=1e-3)
    assert float(sure[0, 0, 2, 3]) == pytest.approx(1.0, abs=1e-3)
    split = similarity.clone()
    split[0, 19, 21] = 20.0  # and cell (2, 3) its second neighbour just as well
    split[0, 20, 21] = 0.0
    flow, _ = best_cells(split, centres)
    assert 8.0 < float(flow[0, 0, 2, 3]) < 16.0


def test_local_correlation_peaks_where_the_second_map_was_moved_to() -> None:
    torch.manual_seed(0)
    first = torch.nn.functional.normalize(torch.randn(1, 16, 12, 12), dim=1)
    second = torch.roll(first, (1, -2), dims=(2, 3))  # down by one, left by two
    seen = local_correlation(first, second, 2)
    best = seen[0, :, 4:8, 4:8].argmax(0)
    assert (best == 3 * 5 + 0).all()


def test_convex_upsampling_keeps_a_constant_and_stays_within_its_neighbours() -> None:
    torch.manual_seed(0)
    mask = torch.randn(1, 144, 5, 6)
    constant = torch.tensor([3.0, -7.0]).reshape(1, 2, 1, 1).expand(1, 2, 5, 6)
    full = convex_upsample(constant, mask)
    assert full.shape == (1, 2, 20, 24)
    assert torch.allclose(full, constant[:, :, :1, :1].expand_as(full), atol=1e-5)
    flow = torch.rand(1, 2, 5, 6)
    assert convex_upsample(flow, mask).max() <= flow.max() + 1e-6


def test_truth_at_a_cell_is_the_truth_at_its_centre() -> None:
    x = (torch.arange(32) + 0.5).expand(16, 32)
    flow = torch.stack([x, torch.zeros(16, 32)]).unsqueeze(0)
    ones = torch.ones(1, 1, 16, 32)
    truth = Truth(flow, ones, ones).at(8)
    assert truth.flow[0, 0, 0].tolist() == pytest.approx([4.0, 12.0, 20.0, 28.0])


def test_the_matching_loss_is_least_for_the_true_cells() -> None:
    ones = torch.ones(1, 1, 4, 4)
    truth = Truth(torch.zeros(1, 2, 4, 4), ones, ones)
    right = 20.0 * torch.eye(16).unsqueeze(0)
    wrong = 20.0 * torch.eye(16).roll(1, 0).unsqueeze(0)
    assert float(matching_loss(right, truth)) < 1e-3 < 10.0 < float(matching_loss(wrong, truth))


def test_the_matching_loss_wants_a_cell_to_have_one_partner_only() -> None:
    ones = torch.ones(1, 1, 4, 4)
    visible = ones.clone()
    visible[0, 0, 1, 1] = 0.0  # the row of this cell is not asked for
    truth = Truth(torch.zeros(1, 2, 4, 4), visible, ones)
    single = 20.0 * torch.eye(16).unsqueeze(0)
    contested = single.clone()
    contested[0, 5, 3] = 20.0  # it claims the partner of another cell
    assert float(matching_loss(contested, truth)) > float(matching_loss(single, truth)) + 0.02


def test_the_whole_loss_reaches_every_weight(network) -> None:
    torch.manual_seed(0)
    learner = DfvsFlow().train()
    features = learner.encode(torch.rand(2, 3, 64, 64))
    match = learner.match(features, features)
    ones = torch.ones(2, 1, 64, 64)
    loss, _ = flow_loss(match, Truth(torch.full((2, 2, 64, 64), 1.5), ones, ones))
    loss.backward()
    idle = [n for n, p in learner.named_parameters() if p.grad is None or not p.grad.any()]
    assert idle == []


def test_the_look_up_loss_asks_for_the_true_place() -> None:
    torch.manual_seed(0)
    learner = DfvsFlow().eval()
    with torch.no_grad():
        features = learner.encode(torch.rand(1, 3, 64, 64))
        look = learner.match(features, features).looks[-1]
    ones = torch.ones(1, 1, 16, 16)
    at_hand = Truth(look.flow + 2.0, ones, ones)
    far = Truth(look.flow + 50.0, ones, ones)
    assert float(look_loss(look, at_hand)) > 0.0
    assert float(look_loss(look, far)) == 0.0  # out of reach: nothing to ask for
    mixed = look.flow + 2.0
    mixed[:, :1, :, 8:] += 50.0
    near = ones.clone()
    near[:, :, :, 8:] = 0.0
    # what is out of reach does not thin out what is asked of the rest
    expected = float(look_loss(look, Truth(look.flow + 2.0, near, ones)))
    assert float(look_loss(look, Truth(mixed, ones, ones))) == pytest.approx(expected, rel=1e-5)


def test_a_place_in_a_picture_warped_by_a_half_turn_leads_to_the_flow() -> None:
    centres = cell_centres(torch.zeros(1, 1, 30, 40), 4)
    turn = torch.tensor([[-0.2, -0.8], [0.8, -0.2]])  # base(x) of a roll of about 45 degrees
    base = torch.einsum("ij,njhw->nihw", turn, centres - 80.0)
    flow = base + torch.tensor([3.0, -2.0]).reshape(1, 2, 1, 1)
    place = before_warp(flow, base)
    inner = (slice(None), slice(None), slice(5, -5), slice(5, -5))
    assert torch.isfinite(place[inner]).all()
    assert float((chained(place, base) - flow)[inner].abs().max()) < 0.01
    # the warped picture is turned back, so the way there is not that of the flow's difference
    assert float((place - (flow - base))[inner].abs().min()) > 0.5
