"""Rounding of the weights of ONNX files, and files that are none."""

import zlib

import numpy as np
import onnx
import pytest
from onnx import numpy_helper
from onnx_network import NetworkBuilder

from dfvs_core.errors import ModelError
from dfvs_export.bundles.tracing import round_weights
from dfvs_export.commands.check import operators

VALUES = np.random.default_rng(1).normal(size=(40, 50)).astype(np.float32)
VALUES[0, :3] = 0.0, 1e-30, -65504.0
COUNTS = np.arange(3)


@pytest.fixture
def data():
    b = NetworkBuilder()
    b.give(b.op("MatMul", "x", b.constant(VALUES)), "y")
    b.constant(COUNTS)
    return b.model({"x": (1, 40)}, {"y": (1, 50)}).SerializeToString()


def weights(data):
    return [numpy_helper.to_array(t) for t in onnx.load_from_string(data).graph.initializer]


def test_weights_keep_17_significant_bits(data):
    rounded, counts = weights(round_weights(data))
    assert rounded.dtype == np.float32
    assert not np.array_equal(rounded, VALUES)
    np.testing.assert_allclose(rounded, VALUES, rtol=2.0**-17, atol=0.0)
    assert not np.any(rounded.view(np.uint32) & 0x7F)
    np.testing.assert_array_equal(counts, COUNTS)


def test_rounded_weights_stay_as_they_are_and_compress_better(data):
    once = round_weights(data)
    assert round_weights(once) == once
    assert len(once) == len(data)
    assert len(zlib.compress(once)) < 0.9 * len(zlib.compress(data))


def test_a_file_that_is_no_network_is_named():
    with pytest.raises(ModelError, match="is not valid ONNX"):
        operators({"manifest.json": b"{}", "encode.onnx": b"no network"})
