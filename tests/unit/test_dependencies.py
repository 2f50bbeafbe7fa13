"""What we depend on: bounded, installed as declared, and consistent. No network is asked."""

import importlib.metadata
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.version import Version

ROOT = Path(__file__).parents[2]
PROJECT, LAB = (
    tomllib.loads((ROOT / folder / "pyproject.toml").read_text())["project"]
    for folder in (".", "lab")
)
OURS = {PROJECT["name"], LAB["name"]}
AIRBORNE = [Requirement(text) for text in PROJECT["dependencies"]]
EVERYTHING = [
    requirement
    for project in (PROJECT, LAB)
    for texts in (project["dependencies"], *project["optional-dependencies"].values())
    for requirement in map(Requirement, texts)
    if requirement.name not in OURS
]
LOCKED_EXTRAS = re.findall(r"--extra (\w+)", (ROOT / "Makefile").read_text())


def pins(path):
    """Exact requirements of a file, without hashes and comments."""
    lines = (ROOT / path).read_text().splitlines()
    return [Requirement(line.strip(" \\")) for line in lines if re.match(r"\w", line)]


def by_name(requirements):
    return {r.name: {str(p) for p in requirements if p.name == r.name} for r in requirements}


def test_both_distributions_have_one_version_and_share_no_command():
    (ours,) = [r for r in map(Requirement, LAB["dependencies"]) if r.name == PROJECT["name"]]
    assert str(ours.specifier) == f"=={PROJECT['version']}" == f"=={LAB['version']}"
    assert not set(PROJECT["scripts"]) & set(LAB["scripts"])


@pytest.mark.parametrize(
    ("lock", "extras"),
    [("deploy/requirements.lock", ["build"]), ("deploy/requirements-extras.lock", LOCKED_EXTRAS)],
)
@pytest.mark.parametrize("python", ["3.11", "3.12", "3.13"])
def test_a_lock_pins_what_an_aircraft_installs_to_hashes(lock, extras, python):
    declared = AIRBORNE + [
        requirement
        for extra in extras
        for requirement in map(Requirement, PROJECT["optional-dependencies"][extra])
    ]
    environment = {"python_version": python, "python_full_version": f"{python}.0"}
    valid = [p for p in pins(lock) if p.marker is None or p.marker.evaluate(environment)]
    versions = {p.name: str(p.specifier).removeprefix("==") for p in valid}
    assert len(versions) == len(valid)
    assert [str(r) for r in declared if not r.specifier.contains(versions.get(r.name, "0"))] == []
    blocks = re.split(r"^(?=\w)", (ROOT / lock).read_text(), flags=re.MULTILINE)[1:]
    assert all("--hash=sha256:" in block for block in blocks)
    assert "://" not in (ROOT / lock).read_text()


def test_an_aircraft_builds_the_wheel_by_the_locked_backend_alone():
    for path in ("docs/how-to/install.md", "deploy/Containerfile"):
        installs = re.findall(r"pip install --no-deps [^&\n]*", (ROOT / path).read_text())
        assert installs
        assert all("--no-build-isolation" in install for install in installs)
    backend = tomllib.loads((ROOT / "pyproject.toml").read_text())["build-system"]["requires"]
    assert backend == PROJECT["optional-dependencies"]["build"]


def test_locks_and_constraints_agree():
    everything = by_name(pins("deploy/requirements-extras.lock"))
    for path in ("deploy/requirements.lock", "constraints.txt"):
        found = by_name(pins(path))
        assert {name: found[name] for name in found.keys() & everything} == {
            name: everything[name] for name in found.keys() & everything
        }
    assert by_name(pins("deploy/requirements.lock")).keys() <= everything.keys()


@pytest.mark.parametrize("requirement", AIRBORNE, ids=lambda r: r.name)
def test_what_flies_is_bounded_to_the_major_version_that_was_tested(requirement):
    uppers = [Version(s.version) for s in requirement.specifier if s.operator == "<"]
    (upper,) = uppers
    installed = Version(importlib.metadata.version(requirement.name))
    assert upper == Version(str(installed.major + 1))


@pytest.mark.parametrize("requirement", EVERYTHING, ids=str)
def test_what_is_installed_is_what_is_declared(requirement):
    try:
        installed = importlib.metadata.version(requirement.name)
    except importlib.metadata.PackageNotFoundError:
        pytest.skip(f"{requirement.name} is of an extra that is not installed")
    assert requirement.specifier.contains(installed, prereleases=True)


def test_no_installed_package_misses_or_contradicts_another():
    """As ``pip check`` does; of packages beside ours nothing is asked."""
    command = [sys.executable, "-m", "pip", "check"]
    told = subprocess.run(command, capture_output=True, text=True, check=False).stdout
    ours = {re.sub(r"[-_.]+", "-", r.name).lower() for r in EVERYTHING} | OURS
    wrong = [line for line in told.splitlines() if line.split(" ")[0].lower() in ours]
    assert wrong == []
