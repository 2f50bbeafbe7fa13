"""When torch and ONNX Runtime count as agreeing, and when accuracy counts as lost."""

import numpy as np
import pytest
import torch

from dfvs_core.correspondence import FlowField
from dfvs_core.matching.evaluation import PairScore, summarise
from dfvs_export.check import error_ratios, parity

SIZE = (4, 6)
PAIR = (np.zeros((*SIZE, 3), np.uint8), np.zeros((*SIZE, 3), np.uint8))


class Still:
    """A network that sees no motion."""

    def flow(self, first: torch.Tensor, second: torch.Tensor) -> torch.Tensor:
        return torch.zeros(1, 2, *SIZE)


class Runner:
    """Gives flow that is zero but for one component of one pixel of one pair."""

    def __init__(self, off: float, confidence: float = 1.0, elsewhere: float = 1.0) -> None:
        self.off, self.confidence, self.elsewhere = [0.0, off, 0.0], confidence, elsewhere

    def tensor(self, image):
        return np.zeros((1, 3, *SIZE), np.float32)

    def encode(self, image):
        return [self.tensor(image)]

    def match(self, first, second):
        flow = np.zeros((*SIZE, 2), np.float32)
        flow[2, 3, 1] = self.off.pop()
        confidence = np.full(SIZE, self.elsewhere, np.float32)
        confidence[2, 3] = self.confidence
        return FlowField(flow, confidence)


@pytest.mark.parametrize(("off", "holds"), [(0.9e-3, True), (1.1e-3, False), (-1.1e-3, False)])
def test_one_pixel_of_one_pair_decides(off: float, holds: bool) -> None:
    found = parity(Still(), Runner(off), [PAIR] * 3)
    assert found.holds is holds
    assert found.greatest_px == pytest.approx(abs(off), rel=1e-5)
    assert found.mean_px == pytest.approx(abs(off) / (3 * 2 * SIZE[0] * SIZE[1]), rel=1e-5)


@pytest.mark.parametrize(("confidence", "holds"), [(0.29, True), (0.31, False)])
def test_what_nobody_trusts_is_told_but_does_not_decide(confidence: float, holds: bool) -> None:
    found = parity(Still(), Runner(0.01, confidence), [PAIR] * 3)
    assert found.holds is holds
    assert found.greatest_px == pytest.approx(0.01, rel=1e-5)


def test_where_nothing_is_trusted_all_of_it_has_to_agree() -> None:
    assert not parity(Still(), Runner(0.01, 0.0, 0.0), [PAIR] * 3).holds


@pytest.mark.parametrize("confidence", [0.0, 1.0])
def test_what_is_no_number_never_agrees(confidence: float) -> None:
    assert not parity(Still(), Runner(float("nan"), confidence), [PAIR] * 3).holds


def score(epe_px: float):
    return summarise([PairScore(epe_px, 1.0, epe_px, 0.0, 1.0, 1.0, 0.0)])


def test_errors_are_compared_level_by_level() -> None:
    ratios = error_ratios(
        {"small": score(1.1), "large": score(3.0)}, {"small": score(1.0), "large": score(4.0)}
    )
    assert ratios == {"small": pytest.approx(1.1), "large": pytest.approx(0.75)}
