"""A model that cannot be trusted, at the door of the real command: exit code 2 and one line."""

import json
from pathlib import Path

import cv2
import depth_bundle
import numpy as np
import onnx
import pytest
from lucas_kanade_network import network, write_bundle
from onnx import numpy_helper

from dfvs_core.manifest import sha256
from dfvs_service.cli import main


@pytest.fixture
def bundle(tmp_path) -> Path:
    return write_bundle(tmp_path / "bundle")


def flip_a_byte(bundle: Path) -> None:
    data = bytearray((bundle / "pair.onnx").read_bytes())
    data[len(data) // 2] ^= 1
    (bundle / "pair.onnx").write_bytes(data)


def announce_another_shape(bundle: Path) -> None:
    manifest = json.loads((bundle / "manifest.json").read_text())
    manifest["input"]["width"] *= 2
    (bundle / "manifest.json").write_text(json.dumps(manifest))


def lose_a_file(bundle: Path) -> None:
    (bundle / "pair.onnx").unlink()


def spoil_a_weight(bundle: Path) -> None:
    """One weight is no number, and the manifest knows the file by its hash all the same."""
    model = network()
    tensor = next(
        t
        for t in model.graph.initializer
        if t.data_type == onnx.TensorProto.FLOAT and len(t.dims) == 4
    )
    values = numpy_helper.to_array(tensor).copy()
    values.flat[0] = np.nan
    tensor.CopyFrom(numpy_helper.from_array(values, tensor.name))
    data = model.SerializeToString()
    (bundle / "pair.onnx").write_bytes(data)
    manifest = json.loads((bundle / "manifest.json").read_text())
    manifest["files"]["pair.onnx"] = sha256(data)
    (bundle / "manifest.json").write_text(json.dumps(manifest))


@pytest.fixture
def assert_refused(tmp_path, refused):
    picture = np.random.default_rng(3).integers(0, 255, (240, 320, 3), dtype=np.uint8)
    cv2.imwrite(str(tmp_path / "goal.png"), picture)
    start = ("--goal", tmp_path / "goal.png", "--camera-fov", "75")

    def assert_refused(words: str, *more: str) -> None:
        assert words in refused(main, *start, *more)

    return assert_refused


@pytest.mark.parametrize(
    ("damage", "words"),
    [
        (flip_a_byte, "the file is damaged or was changed"),
        (announce_another_shape, "expected tensor(float) of"),
        (lose_a_file, "lacks the file 'pair.onnx'"),
        (spoil_a_weight, "not numbers"),
    ],
)
def test_a_damaged_bundle_is_refused_at_start(damage, words, bundle, assert_refused) -> None:
    damage(bundle)
    assert_refused(words, "--model", str(bundle))


@pytest.fixture
def depth(tmp_path) -> Path:
    rho = np.full((24, 32), 0.4)
    return depth_bundle.write_bundle(tmp_path / "depth", depth_bundle.bundle(rho))


def depth_settings(folder: Path | str, choice: str = "fused") -> list[str]:
    return ["--set", f"servo.depth={choice}", "--set", f"depth.model={folder}"]


def change_depth(folder: Path, **changes: object) -> None:
    manifest = json.loads((folder / "manifest.json").read_text())
    manifest |= changes
    (folder / "manifest.json").write_text(json.dumps(manifest))


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"input": {"width": 320, "height": 240}}, "has the inputs"),
        (
            {"depth": {"quantity": "inverse-depth", "unit": "m", "spread": 0.2}},
            "inverse-depth in the unit 'm'",
        ),
        (
            {"depth": {"quantity": "inverse-depth", "unit": "affine", "stride": 2, "spread": 0.2}},
            "unknown offset",
        ),
    ],
)
def test_a_depth_bundle_of_a_wrong_size_or_unit_is_refused(
    changes, words, depth, assert_refused
) -> None:
    change_depth(depth, **changes)
    assert_refused(words, *depth_settings(depth, "network"))


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (depth_settings("dfvs-flow"), "gives no depth"),
        (depth_settings("nowhere"), "there is no model 'nowhere'"),
        (["--set", "servo.depth=given"], "which no camera sends"),
        (
            ["--set", "flow.provider=CUDAExecutionProvider"],
            "no provider 'CUDAExecutionProvider' here; expected one of ",
        ),
    ],
)
def test_a_model_that_gives_nothing_to_fly_by_is_refused(more, words, assert_refused) -> None:
    assert_refused(words, *more)
