"""Which pictures a machine can compare in time."""

import pytest

from dfvs_sim.demo.image_size import affordable_size, match_ms


@pytest.mark.parametrize(
    ("taken_ms", "size"),
    [
        (5.0, "320x240"),
        (28.0, "320x240"),
        (28.1, "256x192"),
        (40.1, "192x144"),
        (1e3, "192x144"),
    ],
)
def test_a_slower_machine_gets_smaller_pictures(taken_ms, size):
    assert affordable_size(taken_ms) == size


def test_a_match_takes_time():
    assert 0.5 < match_ms() < 5_000.0
