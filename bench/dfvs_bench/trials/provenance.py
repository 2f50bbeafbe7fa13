"""What results were made with, to stand beside them."""

import platform
from collections.abc import Iterable
from importlib.metadata import PackageNotFoundError, version
from typing import Any, Protocol

from dfvs_bench.trials.results import git_revision

_PACKAGES = ("dfvs", "numpy", "opencv-python-headless", "onnxruntime", "numba")


class HasRevision(Protocol):
    """A record of a trial or a flight."""

    @property
    def revision(self) -> str:
        """Commit of the program that made it."""


def made_with() -> dict[str, str]:
    """Revision of the program, and versions of all that figures may depend on."""
    return {
        "revision": git_revision(),
        "python": platform.python_version(),
        "machine": f"{platform.system()} {platform.machine()}",
        **{name: _version(name) for name in _PACKAGES},
    }


def run_facts(records: Iterable[HasRevision], wall_s: float) -> dict[str, Any]:
    """What stands beside a summary: this program, that of every trial, and how long it took."""
    return {
        "made_with": made_with(),
        "revisions": sorted({record.revision for record in records}),
        "wall_s": round(wall_s, 1),
    }


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "unknown"
