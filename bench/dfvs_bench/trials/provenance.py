"""What results were made from, as one hash, and with."""

import functools
import hashlib
import json
import platform
import subprocess
from collections.abc import Iterable
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from dfvs_bench.trials.task import BenchTask
from dfvs_core.errors import ConfigError
from dfvs_core.messages.schema import dump
from dfvs_models.catalog import model_files

_PACKAGES = ("dfvs", "numpy", "opencv-python-headless", "onnxruntime", "numba")
_UNKNOWN = "unknown"


def made_with() -> dict[str, str]:
    """Revision of the program, and versions of all that figures may depend on."""
    return {
        "revision": git_revision(),
        "python": platform.python_version(),
        "machine": f"{platform.system()} {platform.machine()}",
        **{name: _version(name) for name in _PACKAGES},
    }


def run_facts(revisions: Iterable[str], wall_s: float) -> dict[str, Any]:
    """What stands beside a summary: this program, those of the trials, and how long it took."""
    return {
        "made_with": made_with(),
        "revisions": sorted(set(revisions)),
        "wall_s": round(wall_s, 1),
    }


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return _UNKNOWN


def git_revision() -> str:
    """Commit of the program, ``+`` after it where files were changed since; or ``unknown``.

    An installed copy may lie in somebody else's repository, whose commit says nothing of it.
    """
    try:
        _git("ls-files", "--error-unmatch", Path(__file__).name)
        return _git("describe", "--always", "--abbrev=10", "--dirty=+") or _UNKNOWN
    except (OSError, subprocess.SubprocessError):
        return _UNKNOWN


def _git(*words: str) -> str:
    command = ["git", "-C", str(Path(__file__).parent), *words]
    done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=20)
    return done.stdout.strip()


def input_digest(
    task: BenchTask, matcher: str, config: Path | None = None, network: str | None = None
) -> str:
    """SHA-256 of the scene file, the intrinsics, the models' files, and a settings file.

    ``matcher`` and ``network`` name the models.

    Raises
    ------
    DfvsError
        If one of them cannot be read.
    """
    parts = {
        "scene": file_digest(task.scene),
        "intrinsics": dump(task.camera),
        "matcher": _matcher_digest(matcher),
        "config": "" if config is None else file_digest(config),
    }
    if network is not None:
        parts["network"] = _matcher_digest(network)
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()


def file_digest(path: Path) -> str:
    """SHA-256 of a file, which is read again only where it was changed.

    Raises
    ------
    ConfigError
        If it cannot be read.
    """
    try:
        return _digest_of(path, path.stat().st_mtime_ns)
    except OSError as error:
        raise ConfigError(f"{path} cannot be read ({error.strerror})", "a file") from error


@functools.lru_cache(maxsize=256)
def _digest_of(path: Path, _changed_ns: int) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


@functools.lru_cache(maxsize=4)
def _matcher_digest(matcher: str) -> str:
    return hashlib.sha256(json.dumps(model_files(matcher), sort_keys=True).encode()).hexdigest()
