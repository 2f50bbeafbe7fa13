"""Versions that perception's results depend on."""

import importlib.metadata

import onnxruntime

from dfvs_service.perception.build import build_versions


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
