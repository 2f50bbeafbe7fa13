from __future__ import annotations

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from dfvs_export.data.pairs import PairSettings, flow_between, make_pair, rotation  # noqa: E402
from dfvs_export.data.photometric import disturb  # noqa: E402
from dfvs_export.data.render import View, render  # noqa: E402
from dfvs_export.data.scenes import Lights, Quads, Scene, make_scene  # noqa: E402
from dfvs_export.data.shards import make_shard, read_shard, write_shard  # noqa: E402
from dfvs_export.data.sheet import warp_back  # noqa: E402
from dfvs_export.data.textures import make_texture_bank  # noqa: E402

SIZE = PairSettings(width=96, height=64)


@pytest.fixture(scope="module")
def bank():
    return make_texture_bank(12, torch.Generator().manual_seed(1))


@pytest.fixture(scope="module")
def pairs(bank):
    g = torch.Generator().manual_seed(5)
    return [make_pair(bank, SIZE, g) for _ in range(6)]


def wall(distance_m: float) -> Scene:
    """A wall across the view of a camera that looks along z, 10 m wide."""
    corner = torch.tensor([[-5.0, -5.0, distance_m]])
    quads = Quads(
        corner,
        torch.tensor([[0.0, 10.0, 0.0]]),
        torch.tensor([[10.0, 0.0, 0.0]]),
        torch.zeros(1, dtype=torch.long),
        torch.tensor([100.0]),
        torch.zeros(1, 2),
        torch.zeros(1),
        torch.ones(1, dtype=torch.bool),
    )
    lights = Lights(1.0, torch.zeros(0, 3), torch.zeros(0), torch.zeros(3, 2), torch.zeros(2))
    return Scene(torch.ones(3), quads, None, lights)  # type: ignore[arg-type]


def test_a_wall_is_as_far_as_it_was_put(bank) -> None:
    view = View(torch.eye(3), torch.zeros(3), 40.0, 64, 48)
    picture = render(wall(2.5), bank, view)
    # float32 with coordinates of some metres
    assert torch.allclose(picture.inverse_depth, torch.tensor(0.4), atol=1e-5)
    assert (picture.surface == 0).all()


def test_flow_of_a_sideways_step_is_focal_length_times_step_over_depth(bank) -> None:
    first = View(torch.eye(3), torch.zeros(3), 40.0, 64, 48)
    second = View(torch.eye(3), torch.tensor([0.25, 0.0, 0.0]), 40.0, 64, 48)
    seen = [render(wall(2.0), bank, v) for v in (first, second)]
    flow, visible, solid = flow_between(first, seen[0], second, seen[1])
    assert torch.allclose(flow, torch.tensor([-5.0, 0.0]), atol=1e-3)
    assert solid.all()
    # five columns leave the image on the left
    assert visible[:, 6:].all()
    assert not visible[:, :4].any()


def test_flow_of_a_roll_turns_about_the_middle(bank) -> None:
    angle = 0.3
    first = View(torch.eye(3), torch.zeros(3), 40.0, 64, 48)
    second = View(rotation(torch.tensor([0.0, 0.0, angle])), torch.zeros(3), 40.0, 64, 48)
    seen = [render(wall(2.0), bank, v) for v in (first, second)]
    flow, _, _ = flow_between(first, seen[0], second, seen[1])
    x, y = 10.5 - 32.0, 20.5 - 24.0
    c, s = np.cos(angle), np.sin(angle)
    expected = [c * x + s * y - x, -s * x + c * y - y]
    assert flow[20, 10].numpy() == pytest.approx(expected, abs=1e-3)


def test_what_hides_behind_another_thing_is_not_visible(bank) -> None:
    scene = wall(4.0)
    near = wall(2.0).quads
    thin = Quads(
        torch.tensor([[0.0, -5.0, 2.0]]),
        near.edge_u,
        torch.tensor([[0.5, 0.0, 0.0]]),
        near.texture,
        near.texels_per_m,
        near.uv_offset,
        near.gloss,
        near.two_sided,
    )
    joined = Quads(
        *(torch.cat([getattr(scene.quads, n), getattr(thin, n)]) for n in Quads.__slots__)
    )
    scene = Scene(scene.size, joined, None, scene.lights)  # type: ignore[arg-type]
    first = View(torch.eye(3), torch.zeros(3), 40.0, 64, 48)
    second = View(torch.eye(3), torch.tensor([0.5, 0.0, 0.0]), 40.0, 64, 48)
    seen = [render(scene, bank, v) for v in (first, second)]
    _, visible, _ = flow_between(first, seen[0], second, seen[1])
    # the bar covers columns 32 to 42 at first, and 22 to 32 from the second place, where the
    # wall's columns 27 to 37 moved by 5 px to: columns 28 to 31 of the first are hidden then
    assert not visible[24, 28:31].any()
    assert visible[24, 33:41].all()
    assert visible[24, 44:60].all()


def test_warping_the_second_view_gives_back_the_first(pairs) -> None:
    for pair in pairs:
        warped = warp_back(pair.image_b.clamp(0, 1).numpy(), pair.flow_ab.numpy())
        seen = pair.visible_a.numpy()
        difference = np.abs(warped - pair.image_a.clamp(0, 1).numpy()).mean(axis=2)[seen]
        shifted = np.roll(warped, 5, axis=1)
        wrong = np.abs(shifted - pair.image_a.clamp(0, 1).numpy()).mean(axis=2)[seen]
        # resampling and highlights cost a little; a flow off by 5 px costs several times that
        assert np.median(difference) < 0.03
        assert difference.mean() < 0.6 * wrong.mean() + 0.01


def test_flow_there_and_back_cancels_where_both_see(pairs) -> None:
    for pair in pairs:
        flow = pair.flow_ab.numpy()
        back = warp_back(np.pad(pair.flow_ba.numpy(), ((0, 0), (0, 0), (0, 1))), flow)[..., :2]
        rest = np.linalg.norm(flow + back, axis=2)[pair.visible_a.numpy()]
        # bilinear reading across edges leaves a few large ones
        assert np.median(rest) < 0.05


def test_pairs_overlap_as_much_as_asked(pairs) -> None:
    for pair in pairs:
        assert float(pair.visible_a.float().mean()) >= SIZE.least_overlap


def test_a_room_surrounds_its_inside(bank) -> None:
    for seed in range(3):
        scene = make_scene(bank.count, torch.Generator().manual_seed(seed))
        walls = Scene(scene.size, scene.quads.select(torch.arange(6)), scene.solids, scene.lights)
        for angle in (0.0, 1.5, 3.0, 4.5):
            R = rotation(torch.tensor([angle, 0.0, 0.0]))
            view = View(R, 0.5 * scene.size, 30.0, 32, 32)
            assert (render(walls, bank, view).surface >= 0).all()


def test_the_same_seed_makes_the_same_shard_and_it_comes_back_from_disk(tmp_path) -> None:
    size = PairSettings(width=64, height=64)
    made = make_shard(size, 2, 3)
    read = read_shard(write_shard(tmp_path, size, 2, 3))
    assert set(read) == set(made)
    for name, values in made.items():
        np.testing.assert_array_equal(values, read[name])
    assert not np.array_equal(made["images"], make_shard(size, 2, 4)["images"])


def test_disturbed_pictures_stay_pictures_and_differ_each_time() -> None:
    torch.manual_seed(0)
    images = torch.rand(16, 3, 44, 60)
    once, again = disturb(images), disturb(images)
    assert once.shape == images.shape
    assert float(once.min()) >= 0.0
    assert float(once.max()) <= 1.0
    assert not torch.equal(once, again)
    torch.manual_seed(0)
    torch.rand(16, 3, 44, 60)
    assert torch.equal(disturb(images), once)
