"""What every test may use."""

import gc
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import settings
from xdist.scheduler import LoadScopeScheduling

ROOT = Path(__file__).parent

settings.register_profile("project", deadline=None, max_examples=50, derandomize=True)
settings.load_profile("project")


TIMED = {"real_time", "paired", "serial"}
"""Markers of tests that are in their time only beside a few others."""

PERCEIVING = {
    "test_killed_service.py": "perception",
    "test_check.py": "perception",
    "test_perception_process.py": "perception",
    "test_ros2_cameras.py": "perception",
    "test_route_process.py": "perception",
}
"""Modules that match images in real time, and groups of which one module runs at a time."""


class ModuleScheduling(LoadScopeScheduling):
    """A module, or a group of modules, on one worker."""

    def _split_scope(self, nodeid: str) -> str:
        scope: str = super()._split_scope(nodeid)
        return PERCEIVING.get(Path(scope).name, scope)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> ModuleScheduling | None:
    return ModuleScheduling(config, log) if config.getvalue("dist") == "loadscope" else None


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begin with the modules that take long: none of them is the last to end."""
    for item in items:
        has_time = TIMED & set(item.keywords)
        if has_time and item.path.relative_to(ROOT).parts[0] not in ("components", "harness"):
            raise pytest.UsageError(
                f"{' or '.join(sorted(TIMED))} outside of components: {item.nodeid}"
            )
    slow = {item.path for item in items if "slow" in item.keywords or item.path.name in PERCEIVING}
    items.sort(key=lambda item: item.path not in slow)


def pytest_collection_finish() -> None:
    """Leave what was collected out of every garbage collection to come."""
    gc.freeze()


@pytest.fixture(autouse=True, scope="session")
def _state_home(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Services of the tests leave their flights in a folder of the tests."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_STATE_HOME", str(tmp_path_factory.mktemp("state")))
        yield


@pytest.fixture(autouse=True)
def _priority_stays() -> Iterator[None]:
    """A test that lowers its process's priority slows down all that follow: it fails.

    One that raises it, as a gate in its process does where it may, has it set back.
    """
    before = os.getpriority(os.PRIO_PROCESS, 0)
    yield
    after = os.getpriority(os.PRIO_PROCESS, 0)
    if after < before:
        os.setpriority(os.PRIO_PROCESS, 0, before)
    assert after <= before


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(20)


@pytest.fixture
def refused(capfd: pytest.CaptureFixture[str]) -> Callable[..., str]:
    """Run a command that cannot: exit code 2 and, of both streams, one line, which it returns."""

    def refused(main: Callable[[list[str]], int], *words: object) -> str:
        capfd.readouterr()
        assert main([str(word) for word in words]) == 2
        out, error = capfd.readouterr()
        assert out == ""
        assert error.startswith("error: ")
        assert error.count("\n") == 1
        return error

    return refused
