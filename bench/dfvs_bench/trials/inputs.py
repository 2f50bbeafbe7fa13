"""What a trial or a flight is made from, as one hash: none may pass for one of other inputs."""

import functools
import hashlib
import json
from pathlib import Path

from dfvs_bench.trials.task import BenchTask
from dfvs_core.errors import ConfigError
from dfvs_core.messages.schema import dump
from dfvs_models.catalog import model_files


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
        "scene": _file_digest(task.scene),
        "intrinsics": dump(task.camera),
        "matcher": _matcher_digest(matcher),
        "config": "" if config is None else _file_digest(config),
    }
    if network is not None:
        parts["network"] = _matcher_digest(network)
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()


def _file_digest(path: Path) -> str:
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
