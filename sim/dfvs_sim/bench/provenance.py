"""What results were made with, to stand beside them."""

from __future__ import annotations

import platform
from importlib.metadata import PackageNotFoundError, version

from dfvs_sim.bench.results import git_revision

_PACKAGES = ("dfvs", "numpy", "opencv-python-headless", "onnxruntime", "numba")


def made_with() -> dict[str, str]:
    """Revision of the program, and versions of all that figures may depend on."""
    return {
        "revision": git_revision(),
        "python": platform.python_version(),
        "machine": f"{platform.system()} {platform.machine()}",
        **{name: _version(name) for name in _PACKAGES},
    }


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "unknown"
