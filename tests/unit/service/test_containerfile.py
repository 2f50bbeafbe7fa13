"""The container file: what can be told of it without a container engine."""

import json
import re
import tomllib
from pathlib import Path

import pytest

from dfvs_service.cli import main

ROOT = Path(__file__).parents[3]
TEXT = (ROOT / "deploy" / "Containerfile").read_text(encoding="utf-8")
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
INSTRUCTIONS = [
    tuple(line.split(maxsplit=1))
    for line in TEXT.replace("\\\n", " ").splitlines()
    if line and not line.startswith("#")
]


def values(name):
    return [value for key, value in INSTRUCTIONS if key == name]


def test_it_copies_all_that_the_package_is_built_from_and_that_exists():
    sources = [
        s for value in values("COPY") for s in value.split()[:-1] if not value.startswith("--")
    ]
    assert all((ROOT / source).exists() for source in sources)
    packages = PROJECT["tool"]["hatch"]["build"]["targets"]["wheel"]["packages"]
    covered = [p for p in packages if any(p == s or p.startswith(f"{s}/") for s in sources)]
    assert covered == packages
    assert {PROJECT["project"]["readme"], *PROJECT["project"]["license-files"]} <= set(sources)


def test_it_installs_no_extra_on_a_python_that_the_package_takes():
    (install,) = [run for run in values("RUN") if "pip install" in run]
    assert "--require-hashes --only-binary :all: -r deploy/requirements.lock " in install
    assert re.search(r"pip install --no-deps --no-build-isolation \. ", install)
    versions = {re.search(r"python:(3\.\d+)-slim", value).group(1) for value in values("FROM")}
    assert len(versions) == 1
    assert (
        f"Programming Language :: Python :: {versions.pop()}" in PROJECT["project"]["classifiers"]
    )


def test_it_runs_as_a_user_of_its_own_that_owns_only_its_folders():
    (user,) = values("USER")
    assert user not in ("root", "0")
    (made,) = [run for run in values("RUN") if "useradd" in run]
    assert made.split("&&")[0].rstrip().endswith(f" {user}")
    assert INSTRUCTIONS.index(("USER", user)) < [key for key, _ in INSTRUCTIONS].index("ENTRYPOINT")


def test_what_it_starts_is_what_the_command_line_knows(capsys):
    (entry,), (words,) = ([json.loads(v) for v in values(k)] for k in ("ENTRYPOINT", "CMD"))
    assert set(entry) <= set(PROJECT["project"]["scripts"])
    with pytest.raises(SystemExit) as ended:
        main(["--help"])
    assert ended.value.code == 0
    told = capsys.readouterr().out
    assert all(word in told for word in words if word.startswith("--"))
    assert values("STOPSIGNAL") == ["SIGTERM"]


def test_nothing_starts_it_again():
    assert "--restart" not in [word for _, value in INSTRUCTIONS for word in value.split()]
    assert values("HEALTHCHECK") == []
