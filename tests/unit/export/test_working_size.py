"""Networks that work on smaller pictures than they are given."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

torch = pytest.importorskip("torch")

from dfvs_core.errors import ConfigError  # noqa: E402
from dfvs_export.working_size import (  # noqa: E402
    Shrink,
    Sizes,
    default_working_size,
    enlarged_flow,
)


@pytest.mark.parametrize(
    ("size", "working"),
    [
        ((320, 240), (256, 192)),
        ((640, 480), (256, 192)),
        ((240, 320), (192, 256)),
        ((192, 144), (192, 144)),
        ((128, 96), (128, 96)),  # never larger than the pictures
        ((640, 128), (256, 64)),  # nor so narrow that nothing is left at 1/16
    ],
)
def test_the_wider_side_is_brought_to_about_256(size, working) -> None:
    assert default_working_size(size) == working


def test_in_8_bits_it_is_smaller() -> None:
    assert default_working_size((320, 240), "int8") == (224, 160)


@pytest.mark.parametrize("working", [(192, 144), (160, 120), (96, 224), (320, 240)])
def test_shrinking_takes_the_mean_over_each_pixels_area(working: tuple[int, int]) -> None:
    picture = np.random.default_rng(1).integers(0, 256, (240, 320, 3), dtype=np.uint8)
    image = torch.from_numpy(picture).permute(2, 0, 1)[None].float() / 255.0
    found = Shrink(Sizes((320, 240), working))(image)[0].permute(1, 2, 0).numpy()
    expected = cv2.resize(picture.astype(np.float32), working, interpolation=cv2.INTER_AREA)
    np.testing.assert_allclose(255.0 * found, expected, atol=1e-3)


def test_a_working_size_beyond_the_pictures_own_is_refused() -> None:
    with pytest.raises(ConfigError, match="working size 336x240"):
        Sizes((320, 240), (336, 240))


def test_flow_is_enlarged_in_place_and_in_length() -> None:
    sizes = Sizes((320, 240), (192, 160))
    x = (torch.arange(192.0) + 0.5).expand(160, 192)
    y = (torch.arange(160.0) + 0.5).unsqueeze(1).expand(160, 192)
    flow = torch.stack([0.1 * x, 0.2 * y])[None]
    full = enlarged_flow(flow, sizes)
    assert full.shape == (1, 2, 240, 320)
    # the same linear motion in px of the pictures; at the rim it is held
    inner = full[0, :, 2:-2, 2:-2]
    x = torch.arange(320.0)[2:-2] + 0.5
    y = (torch.arange(240.0)[2:-2] + 0.5).unsqueeze(1)
    torch.testing.assert_close(inner[0], (0.1 * x).expand_as(inner[0]), atol=1e-3, rtol=0.0)
    torch.testing.assert_close(inner[1], (0.2 * y).expand_as(inner[1]), atol=1e-3, rtol=0.0)
