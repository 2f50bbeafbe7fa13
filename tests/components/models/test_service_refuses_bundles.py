"""A model that cannot be trusted, at the door of the real command: exit code 2 and one line."""

import json
import subprocess
import sys
from pathlib import Path

import cv2
import depth_bundle
import numpy as np
import onnx
import pytest
from lucas_kanade_network import network, write_bundle
from onnx import numpy_helper

from dfvs_core.manifest import sha256

COMMAND = str(Path(sys.executable).parent / "dfvs-service")


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


def start(folder: Path, *more: str) -> subprocess.CompletedProcess[str]:
    goal = folder / "goal.png"
    picture = np.random.default_rng(3).integers(0, 255, (240, 320, 3), dtype=np.uint8)
    cv2.imwrite(str(goal), picture)
    words = [COMMAND, "--goal", str(goal), "--camera-fov", "75", *more]
    return subprocess.run(words, capture_output=True, text=True, timeout=120, check=False)


def assert_refused(done: subprocess.CompletedProcess[str], words: str) -> None:
    assert done.returncode == 2
    assert done.stdout == ""
    assert done.stderr.startswith("error: ")
    assert done.stderr.count("\n") == 1
    assert words in done.stderr


@pytest.mark.parametrize(
    ("damage", "words"),
    [
        (flip_a_byte, "the file is damaged or was changed"),
        (announce_another_shape, "expected tensor(float) of"),
        (lose_a_file, "lacks the file 'pair.onnx'"),
        (spoil_a_weight, "not numbers"),
    ],
)
def test_a_damaged_bundle_is_refused_at_start(damage, words, bundle, tmp_path) -> None:
    damage(bundle)
    assert_refused(start(tmp_path, "--model", str(bundle)), words)


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
def test_a_depth_bundle_of_a_wrong_size_or_unit_is_refused(changes, words, depth, tmp_path) -> None:
    change_depth(depth, **changes)
    assert_refused(start(tmp_path, *depth_settings(depth, "network")), words)


def test_a_bundle_of_another_kind_gives_no_depth(tmp_path) -> None:
    assert_refused(start(tmp_path, *depth_settings("dfvs-flow")), "gives no depth")


def test_a_depth_bundle_that_is_not_there_is_refused(tmp_path) -> None:
    assert_refused(start(tmp_path, *depth_settings("nowhere")), "there is no model 'nowhere'")


def test_depth_that_no_sensor_gives_is_refused(tmp_path) -> None:
    assert_refused(start(tmp_path, "--set", "servo.depth=given"), "which no camera sends")


def test_a_provider_that_is_not_there_is_refused_at_start(tmp_path) -> None:
    done = start(tmp_path, "--set", "flow.provider=CUDAExecutionProvider")
    assert_refused(done, "no provider 'CUDAExecutionProvider' here; expected one of ")
