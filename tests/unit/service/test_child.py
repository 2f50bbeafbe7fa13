"""What a child process is started with: its code, and memory that is resident and stays so."""

import os
import subprocess
import sys

import pytest

from dfvs_service.perception.preallocation import RESERVE_MB
from dfvs_service.supervisor.child import Child

TELL = (
    "import os, sys\n"
    "names = 'MALLOC_ARENA_MAX', 'MALLOC_TRIM_THRESHOLD_', 'NUMPY_MADVISE_HUGEPAGE'\n"
    "names += ('OMP_NUM_THREADS',)\n"
    "print(*(os.environ[name] for name in names), file=sys.stderr)"
)
FLIGHT = """
import gc, resource, sys
import numpy as np
from dfvs_service.perception.preallocation import preallocate

def resident_mb():
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * resource.getpagesize() / 2**20

before = resident_mb()
preallocate()
settled = resident_mb()
blocks = [np.ones(300_000, np.uint8) for _ in range(100)]
flying = resident_mb()
last = blocks.pop()
del blocks
print(round(settled - before), round(flying - settled), round(resident_mb() - settled),
      gc.get_freeze_count() > 0, last.sum(), file=sys.stderr)
"""


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


def shadow(folder, package):
    """Put a package that ends the process into a folder."""
    (folder / package).mkdir()
    (folder / package / "__init__.py").write_text("raise SystemExit(9)", encoding="utf-8")


def test_a_child_imports_nothing_from_the_current_folder(tmp_path, monkeypatch):
    shadow(tmp_path, "dfvs_core")
    monkeypatch.chdir(tmp_path)
    child = Child((sys.executable, "-m", "dfvs_service.gate", "--help"), tmp_path / "stderr")
    assert child.wait(60.0)
    assert child.code == 0


def test_a_command_that_is_run_anew_imports_nothing_from_the_current_folder(tmp_path):
    shadow(tmp_path, "json")
    code = (
        "from dfvs_service.supervisor.child import use_one_blas_thread\n"
        "use_one_blas_thread('json.tool')"
    )
    ran = subprocess.run(
        [sys.executable, "-P", "-c", code, "--help"],
        cwd=tmp_path,
        env={name: value for name, value in os.environ.items() if name != "OMP_NUM_THREADS"},
        capture_output=True,
        check=False,
    )
    assert ran.returncode == 0


def test_a_flight_takes_no_memory_that_was_not_reserved(tmp_path):
    child = Child((sys.executable, "-c", FLIGHT), tmp_path / "stderr")
    assert child.wait(60.0)
    (line,) = child.new_errors()
    reserved, taken, left, frozen, kept = line.split()
    assert RESERVE_MB - 2 <= int(reserved) <= RESERVE_MB + 5
    assert abs(int(taken)) <= 1
    assert abs(int(left)) <= 1
    assert frozen == "True"
    assert int(kept) == 300_000
