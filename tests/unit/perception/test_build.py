"""Versions that perception's results depend on."""

import importlib.metadata

import onnxruntime
import pytest

from dfvs_service.perception.build import build_versions, processor_name


def test_onnx_runtime_has_a_version_under_whatever_name_it_was_installed(monkeypatch):
    found = importlib.metadata.version

    def version(name):
        if name == "onnxruntime":  # it is onnxruntime-gpu, onnxruntime-openvino and the like
            raise importlib.metadata.PackageNotFoundError(name)
        return found(name)

    monkeypatch.setattr(importlib.metadata, "version", version)
    versions = build_versions()
    assert versions["onnxruntime"] == onnxruntime.__version__
    assert "CPUExecutionProvider" in versions["onnxruntime_providers"]


CORE = "processor\t: 0\nBogoMIPS\t: 108.00\nFeatures\t: fp asimd\nCPU implementer\t: 0x41\n"
"""Of an ARM core, as Linux prints it, without its part."""


@pytest.mark.parametrize(
    ("cpuinfo", "name"),
    [
        ("model\t\t: 85\nmodel name\t: A processor @ 2 GHz\n" * 4, "A processor @ 2 GHz"),
        (f"{CORE}CPU part\t: 0xd08\n" * 4, "0x41 0xd08"),
        (f"{CORE}CPU part\t: 0xd0b\n" * 4, "0x41 0xd0b"),
        (f"{CORE}CPU part\t: 0xd05\n{CORE}CPU part\t: 0xd0b\n", "0x41 0xd05 0xd0b"),
    ],
)
def test_every_processor_has_its_name(cpuinfo, name, tmp_path):
    (tmp_path / "cpuinfo").write_text(cpuinfo)
    assert processor_name(tmp_path / "cpuinfo") == name
