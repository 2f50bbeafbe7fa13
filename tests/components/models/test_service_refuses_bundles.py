"""A model that cannot be trusted, at the door of the service: exit code 2 and one line.

Everything that is wrong with a bundle by itself is tried where bundles are read.
"""

import cv2
import depth_bundle
import numpy as np
import onnx_network
import pytest
from lucas_kanade_network import write_bundle

from dfvs_service.cli import main


def damaged_flow(folder):
    path = write_bundle(folder) / "pair.onnx"
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(data)
    return ["--model", str(folder)]


def depth_settings(model, choice="fused"):
    return ["--set", f"servo.depth={choice}", "--set", f"depth.model={model}"]


def affine_depth(folder):
    made = depth_bundle.bundle(np.full((24, 32), 0.4), unit="affine")
    return depth_settings(onnx_network.write_bundle(folder, made), "network")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (damaged_flow, "the file is damaged or was changed"),
        (affine_depth, "unknown offset"),
        (lambda _: depth_settings("dfvs-flow"), "gives no depth"),
        (lambda _: depth_settings("nowhere"), "there is no model 'nowhere'"),
        (lambda _: ["--set", "servo.depth=given"], "which no camera sends"),
        (
            lambda _: ["--set", "flow.provider=CUDAExecutionProvider"],
            "no provider 'CUDAExecutionProvider' here; expected one of ",
        ),
    ],
)
def test_a_model_that_cannot_be_flown_by_is_refused_at_start(words, said, tmp_path, refused):
    picture = np.random.default_rng(3).integers(0, 255, (240, 320, 3), dtype=np.uint8)
    cv2.imwrite(str(tmp_path / "goal.png"), picture)
    start = ("--goal", tmp_path / "goal.png", "--camera-fov", "75")
    assert said in refused(main, *start, *words(tmp_path / "bundle"))
