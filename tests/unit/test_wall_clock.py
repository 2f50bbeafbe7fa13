"""Decisions use monotonic time alone (I7): a wall clock that jumps must reach none of them."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent.parent
DECIDING = [
    *sorted((ROOT / "dfvs_core").rglob("*.py")),
    *sorted((ROOT / "service/dfvs_service/gate").glob("*.py")),
    *sorted((ROOT / "service/dfvs_service/supervisor").glob("*.py")),
    ROOT / "service/dfvs_service/perception/frame_processor.py",
    ROOT / "service/dfvs_service/mailbox.py",
    ROOT / "service/dfvs_service/goal_store.py",
]
WALL_CLOCKS = {
    *("time", "time_ns", "localtime", "gmtime", "ctime", "clock_gettime", "clock_gettime_ns"),
    *("now", "utcnow", "today"),
}
FILE_TIMES = {
    *("st_atime", "st_mtime", "st_ctime", "st_atime_ns", "st_mtime_ns", "st_ctime_ns"),
    *("getatime", "getmtime", "getctime"),
}


def wall_clocks(source):
    """Names of wall clocks, and of times of files, that a module reads."""
    found = []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Attribute) and node.attr in FILE_TIMES:
            found.append(ast.unparse(node))
        elif isinstance(node, ast.Attribute) and node.attr in WALL_CLOCKS:
            owner = ast.unparse(node.value)
            if owner in ("time", "datetime", "date", "datetime.datetime", "datetime.date"):
                found.append(f"{owner}.{node.attr}")
        elif isinstance(node, ast.ImportFrom) and node.module in ("time", "datetime"):
            found += [f"{node.module}.{a.name}" for a in node.names if a.name in WALL_CLOCKS]
    return found


@pytest.mark.parametrize("path", DECIDING, ids=lambda p: str(p.relative_to(ROOT)))
def test_no_decision_reads_a_wall_clock(path):
    assert wall_clocks(path.read_text()) == []


@pytest.mark.parametrize(
    "source",
    [
        *("import time\ntime.time()", "from time import time_ns", "datetime.now()"),
        *("path.stat().st_mtime_ns", "os.path.getmtime(path)"),
    ],
)
def test_a_wall_clock_is_found(source):
    assert wall_clocks(source)
