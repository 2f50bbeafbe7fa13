"""Interiors drawn from seeds: what must hold of every one."""

import functools

import numpy as np
import pytest

from dfvs_core.errors import ConfigError
from dfvs_rooms.generator.interior import KINDS, draw_layout, drawn_interior
from dfvs_rooms.generator.interior_materials import interior_materials
from dfvs_rooms.generator.layout import Layout, Piece
from dfvs_rooms.generator.solids import box

SEEDS = (1, 2)


@functools.cache
def furniture(kind, seed):
    return draw_layout(KINDS[kind], np.random.default_rng(seed))


@pytest.mark.parametrize("kind", KINDS)
class TestEveryKind:
    def test_stays_inside_its_shell(self, kind):
        for seed in SEEDS:
            layout = furniture(kind, seed)
            points = np.concatenate([part.vertices for part in layout.parts])
            assert (np.abs(points[:, :2]) <= layout.half + 1e-9).all()
            # a leg that leans dips its rim into the floor by less than a millimetre
            assert points[:, 2].min() >= -1e-3
            assert points[:, 2].max() <= layout.height_m + 1e-9

    def test_has_light_and_stays_light_enough_to_draw(self, kind):
        for seed in SEEDS:
            layout = furniture(kind, seed)
            assert any(part.emission > 0 for part in layout.parts)
            assert sum(len(part.triangles) for part in layout.parts) < 120_000
            for opening in layout.openings:
                middle = np.array(opening.middle_m)
                # it hangs before a wall and shines away from it, into the room
                before = layout.half - np.abs(middle[:2])
                assert before.min() == pytest.approx(0.07)
                assert middle @ opening.inwards < 0
                # its pane is behind the frame, which would be dark otherwise
                before_pane = (middle - opening.pane_middle) @ opening.inwards
                assert before_pane == pytest.approx(0.068)

    def test_is_decided_by_its_seed(self, kind):
        a, c = (furniture(kind, seed) for seed in SEEDS)
        b = draw_layout(KINDS[kind], np.random.default_rng(SEEDS[0]))
        assert len(a.parts) == len(b.parts)
        for one, same in zip(a.parts, b.parts, strict=True):
            np.testing.assert_array_equal(one.vertices, same.vertices)
        assert not np.array_equal(a.half, c.half)


def test_an_interior_has_a_picture_for_all_that_is_in_it():
    room = drawn_interior(8, "corridor")
    assert {part.material for part in room.parts} <= set(room.materials)
    assert room.walls
    assert room.walls <= set(room.materials)
    assert room.materials["globe"].shines


def test_a_kind_that_does_not_exist_is_answered_with_those_that_do():
    with pytest.raises(ConfigError, match="'cave'; expected one of lounge, study, corridor, hall"):
        drawn_interior(1, "cave")


def test_materials_of_one_kind_differ_and_keep_to_their_seed():
    first = interior_materials(["wall0", "wall1"], np.random.default_rng(3))
    again = interior_materials(["wall1", "wall0"], np.random.default_rng(3))
    for name in ("wall0", "wall1"):
        np.testing.assert_array_equal(first[name].image, again[name].image)
    assert not np.array_equal(first["wall0"].image, first["wall1"].image)


class TestLayout:
    def test_never_puts_two_things_in_one_place(self):
        layout = Layout((5.0, 4.0, 2.5), np.random.default_rng(5))
        crate = Piece.standing(box((0.6, 0.4, 0.8), (0, 0, 0), "carton"))
        put = sum(layout.against_wall(crate) for _ in range(40))
        put += sum(layout.in_the_middle(crate, turned=False) for _ in range(40))
        assert put > 15
        faces = len(crate.parts)
        points = np.array(
            [
                np.concatenate([p.vertices for p in layout.parts[faces * k : faces * (k + 1)]])
                for k in range(put)
            ]
        )
        low, high = points.min(axis=1)[:, :2], points.max(axis=1)[:, :2]
        for k in range(put):
            apart = ((low[k] >= high - 1e-9) | (high[k] <= low + 1e-9)).any(axis=1)
            assert apart.sum() == put - 1

    def test_backs_a_piece_against_its_wall_and_turns_its_front_to_the_room(self):
        layout = Layout((5.0, 4.0, 2.5), np.random.default_rng(1))
        front = box((0.6, 0.1, 0.8), (0, -0.4, 0), "front")
        assert all(
            layout.against_wall(Piece.standing(front + box((0.6, 0.3, 0.8), (0, 0, 0), "back")))
            for _ in range(4)
        )
        faces = len(layout.parts) // 4
        for k in range(4):
            parts = layout.parts[faces * k : faces * (k + 1)]
            back, front = (
                layout.half
                - np.abs(np.concatenate([p.vertices for p in parts if p.material == m]))[:, :2]
                for m in ("back", "front")
            )
            axis = np.unravel_index(back.argmin(), back.shape)[1]
            assert back[:, axis].min() == pytest.approx(0.002)
            assert front[:, axis].min() == pytest.approx(0.002 + 0.5)

    def test_finds_no_place_for_what_is_larger_than_the_room(self):
        layout = Layout((3.0, 2.0, 2.5), np.random.default_rng(1))
        giant = Piece.standing(box((4.0, 4.0, 1.0), (0, 0, 0), "carton"))
        assert not layout.against_wall(giant)
        assert not layout.in_the_middle(giant)
        assert layout.on_wall(Piece.hanging(giant.parts), (1.0, 1.5)) is None
        assert layout.parts == []
