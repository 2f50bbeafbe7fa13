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

PROJECT = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text())["project"]
AIRBORNE = [Requirement(text) for text in PROJECT["dependencies"]]
EVERYTHING = AIRBORNE + [
    requirement
    for extra in PROJECT["optional-dependencies"].values()
    for requirement in map(Requirement, extra)
    if requirement.name != PROJECT["name"]
]


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
    ours = {re.sub(r"[-_.]+", "-", r.name).lower() for r in EVERYTHING} | {"dfvs"}
    wrong = [line for line in told.splitlines() if line.split(" ")[0].lower() in ours]
    assert wrong == []
