"""Frames to calibrate on, from files and folders that may be anything."""

from pathlib import Path

import cv2
import grid_network
import lucas_kanade_network
import numpy as np
import pytest

from dfvs_core.errors import ConfigError
from dfvs_export.bundles.runner import BundleRunner
from dfvs_export.precision.calibration import graph_feeds, read_frames
from dfvs_models.bundle import read_bundle

SIZE = (32, 16)


def images(count: int, level: int = 0) -> np.ndarray:
    """Plain images (N, 16, 32, 3), each of its number's brightness."""
    numbers = np.arange(count, dtype=np.uint8) + np.uint8(level)
    return np.broadcast_to(numbers[:, None, None, None], (count, 16, 32, 3)).copy()


def brightness(pairs) -> list[tuple[int, int]]:
    return [(int(a[0, 0, 0]), int(b[0, 0, 0])) for a, b in pairs]


@pytest.mark.parametrize(("count", "taken"), [(3, [0, 4, 8]), (30, range(9))])
def test_pairs_of_a_file_are_taken_evenly_or_all(tmp_path: Path, count, taken) -> None:
    np.savez(tmp_path / "p.npz", IA=images(9), IB=images(9, 100))
    pairs = read_frames(tmp_path / "p.npz", SIZE, count)
    assert brightness(pairs) == [(k, 100 + k) for k in taken]


def test_images_of_a_folder_are_paired_half_a_flight_apart(tmp_path: Path) -> None:
    for k, image in enumerate(images(6)):
        cv2.imwrite(str(tmp_path / f"frame{k:03}.png"), image)
    (tmp_path / "notes.txt").write_text("no image")
    assert brightness(read_frames(tmp_path, SIZE, 9)) == [(0, 3), (1, 4), (2, 5)]


def test_colours_are_read_as_rgb(tmp_path: Path) -> None:
    red = np.zeros((16, 32, 3), np.uint8)
    red[..., 2] = 200  # OpenCV writes BGR
    for k in range(2):
        cv2.imwrite(str(tmp_path / f"{k}.png"), red)
    ((first, _),) = read_frames(tmp_path, SIZE, 1)
    assert first[0, 0].tolist() == [200, 0, 0]


def test_images_of_another_size_are_resized(tmp_path: Path) -> None:
    np.savez(tmp_path / "p.npz", IA=images(1), IB=images(1))
    ((first, second),) = read_frames(tmp_path / "p.npz", (64, 48), 1)
    assert first.shape == second.shape == (48, 64, 3)


def feeds_of(folder: Path, count: int):
    runner = BundleRunner(read_bundle(folder))
    return graph_feeds(runner, list(zip(images(count), images(count, 100), strict=True)))


def test_both_graphs_are_calibrated_on_what_goes_into_them(tmp_path: Path) -> None:
    """A black image has no keypoints to be matched."""
    feeds = feeds_of(grid_network.write_bundle(tmp_path), 3)
    levels = [0.0, 100.0, 1.0, 101.0, 2.0, 102.0]
    assert [feed["image"].mean() for feed in feeds["encode"]] == levels
    shown = [(f["first_scores"].mean(), f["second_scores"].mean()) for f in feeds["match"]]
    np.testing.assert_allclose(shown, np.array([(1.0, 101.0), (2.0, 102.0)]) / 255.0, rtol=1e-5)
    assert feeds["match"][0]["second_points"].shape == (1, grid_network.COUNT, 2)


def test_frames_without_keypoints_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="no two frames to calibrate on have keypoints"):
        feeds_of(grid_network.write_bundle(tmp_path), 1)


def test_a_network_of_two_images_is_calibrated_on_both(tmp_path: Path) -> None:
    feeds = feeds_of(lucas_kanade_network.write_bundle(tmp_path), 2)
    assert set(feeds) == {"pair"}
    shown = [(f["current"].mean(), f["other"].mean()) for f in feeds["pair"]]
    np.testing.assert_allclose(shown, np.array([(0.0, 100.0), (1.0, 101.0)]) / 255.0, rtol=1e-5)


def archive(**arrays: np.ndarray):
    """Maker of a file of some arrays."""

    def make(folder: Path) -> Path:
        np.savez(folder / "x.npz", **arrays)
        return folder / "x.npz"

    return make


def no_archive(folder: Path) -> Path:
    (folder / "x.npz").write_bytes(b"PK\x03\x04 and no more")
    return folder / "x.npz"


def broken_images(folder: Path) -> Path:
    for k in range(2):
        (folder / f"{k}.png").write_bytes(b"no image")
    return folder


@pytest.mark.parametrize(
    "make",
    [
        pytest.param(lambda folder: folder, id="empty folder"),
        pytest.param(lambda folder: folder / "gone.npz", id="missing file"),
        pytest.param(no_archive, id="no archive"),
        pytest.param(archive(IA=images(2)), id="no second images"),
        pytest.param(archive(IA=images(2) / 255.0, IB=images(2) / 255.0), id="floats"),
        pytest.param(archive(IA=images(2), IB=images(3)), id="unequal counts"),
        pytest.param(archive(IA=np.array([{}]), IB=np.array([{}])), id="objects"),
        pytest.param(broken_images, id="broken images"),
    ],
)
def test_what_holds_no_pairs_is_refused_in_one_line(make, tmp_path: Path) -> None:
    with pytest.raises(ConfigError) as caught:
        read_frames(make(tmp_path), SIZE, 4)
    assert "\n" not in str(caught.value)
    assert "a folder of images" in str(caught.value) or "uint8" in str(caught.value)
