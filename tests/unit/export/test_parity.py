"""When torch and ONNX Runtime count as agreeing, and when accuracy counts as lost."""

import numpy as np
import pytest

from dfvs_export.checks.accuracy import error_ratios
from dfvs_export.checks.parity import drawn_pairs, parity
from dfvs_models.evaluation import PairScore, summarise

PAIR = (np.zeros((4, 6, 3), np.uint8), np.zeros((4, 6, 3), np.uint8))
VECTORS = 24


class Network:
    """Differs from its ONNX files by one vector of one pair."""

    def __init__(self, off: float) -> None:
        self.off = [0.0, off, 0.0]

    def differences(self, runner, pair):
        differences = np.zeros(VECTORS, np.float32)
        differences[7] = self.off.pop()
        return differences


@pytest.mark.parametrize(("off", "holds"), [(0.9e-3, True), (1.1e-3, False)])
def test_one_vector_of_one_pair_decides(off: float, holds: bool) -> None:
    found = parity(Network(off), None, [PAIR] * 3)
    assert found.holds is holds
    assert found.greatest == pytest.approx(off, rel=1e-5)
    assert found.mean == pytest.approx(off / (3 * VECTORS), rel=1e-5)


@pytest.mark.parametrize("off", [float("nan"), float("inf")])
def test_what_is_not_finite_never_agrees(off: float) -> None:
    found = parity(Network(off), None, [PAIR] * 3)
    assert not found.holds
    assert not np.isfinite(found.greatest)


def test_drawn_pairs_are_the_same_for_a_seed_and_others_for_another() -> None:
    first, again, other = (drawn_pairs((64, 48), 2, seed) for seed in (1, 1, 2))
    for a, b in zip(first, again, strict=True):
        assert a[0].tobytes() == b[0].tobytes()
        assert a[1].tobytes() == b[1].tobytes()
    assert first[0][0].tobytes() != first[1][0].tobytes()
    assert first[0][0].tobytes() != other[0][0].tobytes()


def test_drawn_pairs_have_the_size_and_show_something() -> None:
    ((first, second),) = drawn_pairs((64, 48), 1, 3)
    for image in (first, second):
        assert image.shape == (48, 64, 3)
        assert image.dtype == np.uint8
        assert image.std() > 20.0
    assert (first != second).mean() > 0.3


def score(epe_px: float):
    return summarise([PairScore(epe_px, 1.0, epe_px, 0.0, 1.0, 1.0, 0.0)])


def test_errors_are_compared_level_by_level() -> None:
    ratios = error_ratios(
        {"small": score(1.1), "large": score(3.0)}, {"small": score(1.0), "large": score(4.0)}
    )
    assert ratios == {"small": pytest.approx(1.1), "large": pytest.approx(0.75)}
