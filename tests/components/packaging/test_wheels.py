"""Both distributions as wheels: content, size, and commands in an environment without extras."""

import importlib.metadata
import os
import re
import subprocess
import sys
import tomllib
import venv
import zipfile
from pathlib import Path

import pytest
from packaging.requirements import Requirement

from dfvs_common.lifecycle import ONE_BLAS_THREAD

ROOT = Path(__file__).parents[3]
AIRCRAFT, LAB = (
    tomllib.loads((ROOT / folder / "pyproject.toml").read_text())["project"]
    for folder in (".", "lab")
)
MAX_BYTES = 10_000_000
"""Of the aircraft's wheel; the networks in it have 9.3 million, compressed."""

NEEDS = [
    ("dfvs[dashboard]", "dfvs-dashboard"),
    ("dfvs[record]", "dfvs-record --out flights"),
    ("dfvs[record]", "dfvs-replay flight.mcap"),
    ("dfvs[record]", "dfvs-foxglove"),
    ("dfvs[metrics]", "dfvs-metrics"),
    ("dfvs[ros]", "dfvs-ros2"),
    ("dfvs[deploy]", "dfvs-certs --out certificates"),
    ("dfvs[report]", "dfvs-report flight"),
    ("dfvs-lab[export]", "dfvs-export flow --out bundle"),
    ("dfvs-lab[bake]", "dfvs-rooms room --seed 1 --out room.glb"),
]
VERSIONS = """
import contextlib, runpy, sys
for path in sys.argv[1:]:
    sys.argv = [path, "--version"]
    with contextlib.suppress(SystemExit):
        runpy.run_path(path, run_name="__main__")
"""
pytestmark = pytest.mark.slow


def needed_by(project):
    """Names of the distributions that a project needs without its extras, and with theirs."""
    wanted = [Requirement(text) for text in project["dependencies"]]
    found = set()
    while wanted:
        requirement = wanted.pop()
        extras = frozenset(requirement.extras)
        if (requirement.name, extras) in found:
            continue
        found.add((requirement.name, extras))
        if requirement.name == AIRCRAFT["name"]:
            optional = AIRCRAFT["optional-dependencies"]
            texts = [*AIRCRAFT["dependencies"], *(t for extra in extras for t in optional[extra])]
        else:
            texts = importlib.metadata.requires(requirement.name) or []
        for text in texts:
            inner = Requirement(text)
            if inner.marker is None or any(
                inner.marker.evaluate({"extra": extra}) for extra in ("", *extras)
            ):
                wanted.append(inner)
    return {name for name, _ in found} - {AIRCRAFT["name"]}


def environment(folder, project, wheels):
    """Folder of the commands of an environment with these wheels and what the project needs."""
    venv.create(folder, symlinks=True)
    (site,) = folder.glob("lib/python*/site-packages")
    for name in needed_by(project):
        distribution = importlib.metadata.distribution(name)
        tops = {file.parts[0] for file in distribution.files} - {"..", "__pycache__"}
        for top in tops:
            if not (site / top).exists():
                (site / top).symlink_to(distribution.locate_file(top))
    pip = [sys.executable, "-m", "pip", "--python", str(folder / "bin" / "python"), "install"]
    subprocess.run([*pip, "--quiet", "--no-deps", "--no-index", *wheels], check=True)
    return folder / "bin"


@pytest.fixture(scope="session")
def wheels(tmp_path_factory):
    """Wheels of the aircraft and of the laboratory."""
    folder = tmp_path_factory.mktemp("wheels")
    pip = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--no-build-isolation"]
    subprocess.run([*pip, "--wheel-dir", folder, ROOT, ROOT / "lab"], check=True)
    return next(folder.glob("dfvs-*.whl")), next(folder.glob("dfvs_lab-*.whl"))


@pytest.fixture(scope="session")
def commands(wheels, tmp_path_factory):
    """Path of every command, in an environment without its distribution's extras."""
    folder = tmp_path_factory.mktemp("environments")
    aircraft = environment(folder / "aircraft", AIRCRAFT, wheels[:1])
    lab = environment(folder / "lab", LAB, wheels)
    return {name: aircraft / name for name in AIRCRAFT["scripts"]} | {
        name: lab / name for name in LAB["scripts"]
    }


@pytest.fixture
def run(commands, tmp_path):
    def run(name, *words):
        return subprocess.run(
            [commands[name], *words],
            capture_output=True,
            text=True,
            check=False,
            cwd=tmp_path,
            env={"HOME": str(tmp_path), "PATH": "/usr/bin:/bin"},
        )

    return run


def test_the_aircraft_s_wheel_is_small_and_holds_nothing_of_the_laboratory(wheels):
    aircraft, _ = wheels
    assert aircraft.stat().st_size <= MAX_BYTES
    names = zipfile.ZipFile(aircraft).namelist()
    tops = {name.partition("/")[0] for name in names if ".dist-info/" not in name}
    assert tops == {"dfvs", "dfvs_core", "dfvs_common", "dfvs_models", "dfvs_service"}
    assert [n for n in names if Path(n).suffix in (".glb", ".pt", ".safetensors", ".npz")] == []
    assert any(name.endswith("dfvs-flow/match.onnx") for name in names)


def test_the_laboratory_s_wheel_holds_its_rooms_with_their_assets(wheels):
    names = zipfile.ZipFile(wheels[1]).namelist()
    tops = {name.partition("/")[0] for name in names if ".dist-info/" not in name}
    assert tops == {"dfvs_sim", "dfvs_rooms", "dfvs_bench", "dfvs_robustness", "dfvs_export"}
    assert {"dfvs_sim/assets/living_room.glb", "dfvs_export/assets/dfvs-flow.pt"} <= set(names)
    assert any(name.endswith("LICENSE") for name in names)


@pytest.mark.parametrize("project", [AIRCRAFT, LAB], ids=["aircraft", "lab"])
def test_every_command_tells_its_version(commands, project):
    """All of an environment in one process, which none has to begin anew for one BLAS thread."""
    paths = [str(commands[name]) for name in project["scripts"]]
    python = commands[next(iter(project["scripts"]))].parent / "python"
    told = subprocess.run(
        [python, "-c", VERSIONS, *paths],
        capture_output=True,
        text=True,
        check=False,
        env=os.environ | ONE_BLAS_THREAD,
    )
    assert (told.returncode, told.stderr) == (0, "")
    expected = [f"{name} {AIRCRAFT['version']}" for name in project["scripts"]]
    assert told.stdout.splitlines() == expected


@pytest.mark.parametrize("name", [*AIRCRAFT["scripts"], *LAB["scripts"]])
def test_every_command_starts_without_extras(run, name):
    told = run(name, "--help")
    assert (told.returncode, told.stderr) == (0, "")
    assert told.stdout.startswith(f"usage: {name}")


@pytest.mark.parametrize(("extra", "line"), NEEDS)
def test_a_command_that_needs_an_extra_says_how_to_install_it(run, extra, line):
    ended = run(*line.split())
    assert (ended.returncode, ended.stdout) == (2, "")
    assert re.fullmatch(rf"error: .*pip install '{re.escape(extra)}'\n", ended.stderr), ended.stderr
