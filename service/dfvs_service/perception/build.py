"""Versions of code, libraries and processor that perception's results depend on."""

import hashlib
import importlib.metadata
import platform
from pathlib import Path

import cv2
import numpy as np
import onnxruntime

import dfvs_core
import dfvs_models
from dfvs_service import perception

_SOURCES = (dfvs_core, dfvs_models, perception)


def build_versions() -> dict[str, str]:
    """Versions by name; ``source`` is a SHA-256 over the Python code that perception runs."""
    return {
        "dfvs": importlib.metadata.version("dfvs"),
        "source": _source_digest(),
        "numpy": np.__version__,
        # Its builds for a GPU are distributions of other names.
        "onnxruntime": onnxruntime.__version__,
        "onnxruntime_providers": ", ".join(onnxruntime.get_available_providers()),
        "opencv": cv2.__version__,
        "python": platform.python_version(),
        "machine": platform.machine(),
        "processor": processor_name(),
    }


def _source_digest() -> str:
    """SHA-256 over names and contents of all source files, in the order of their names."""
    digest = hashlib.sha256()
    for package in _SOURCES:
        root = Path(package.__path__[0])
        for path in sorted(root.rglob("*.py")):
            digest.update(str(path.relative_to(root)).encode() + b"\0")
            digest.update(path.read_bytes() + b"\0")
    return digest.hexdigest()


def processor_name(cpuinfo: Path = Path("/proc/cpuinfo")) -> str:
    """Name of the processor: its instruction set decides on the last bits of some sums.

    Linux names ARM's by implementer and part, a part for each kind of core.
    """
    try:
        lines = cpuinfo.read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor()
    keys = ("model name", "CPU implementer", "CPU part")
    names = dict.fromkeys(line.partition(":")[2].strip() for line in lines if line.startswith(keys))
    return " ".join(names) or platform.processor()
