"""ONNX Runtime keeps no record of what is run for its makers, and sends them none."""

import subprocess
import sys

import pytest

LOADS = "from dfvs_models.catalog import load_matcher; load_matcher('dfvs-flow', 1)"
EXPORTS = "import dfvs_export.precision.int8; " + LOADS


@pytest.mark.parametrize("code", [LOADS, EXPORTS])
def test_a_process_that_loads_a_network_leaves_nothing_to_be_sent(tmp_path, code):
    """Its record would lie below the home folder; CI variables, which also stop it, are not set."""
    home = {"HOME": str(tmp_path), "PATH": ""}
    subprocess.run([sys.executable, "-c", code], env=home, check=True, timeout=120)
    assert list(tmp_path.rglob("onnxruntime*")) == []
