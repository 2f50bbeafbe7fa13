"""What a child process is started with."""

import sys

import pytest

from dfvs_service.supervisor.child import Child

TELL = (
    "import os, sys\n"
    "names = 'MALLOC_ARENA_MAX', 'MALLOC_TRIM_THRESHOLD_', 'NUMPY_MADVISE_HUGEPAGE'\n"
    "names += ('OMP_NUM_THREADS',)\n"
    "print(*(os.environ[name] for name in names), file=sys.stderr)"
)


@pytest.mark.parametrize(("arenas", "told"), [(None, "1"), ("7", "7")])
def test_a_child_has_a_steady_heap_unless_the_user_says_otherwise(
    arenas, told, tmp_path, monkeypatch
):
    monkeypatch.delenv("MALLOC_ARENA_MAX", raising=False)
    if arenas is not None:
        monkeypatch.setenv("MALLOC_ARENA_MAX", arenas)
    child = Child((sys.executable, "-c", TELL), tmp_path / "stderr")
    assert child.wait(60.0)
    assert child.new_errors() == [f"{told} {256 << 20} 0 1"]
