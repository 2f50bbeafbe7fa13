"""Pairs of views to train on, and what commands tell."""

import json

import pytest
import torch
from built_in_room import built_in_room

from dfvs_export.cli import main
from dfvs_rooms.pairs.evaluation import write_arrays
from dfvs_rooms.pairs.wide import WidePairSampler


@pytest.fixture(scope="session")
def folder(tmp_path_factory):
    """A handful of the built-in room."""
    out = tmp_path_factory.mktemp("pairs")
    sampler = WidePairSampler(built_in_room(), 3)
    write_arrays(out / "room.npz", sampler.arrays(4))
    return out


@pytest.fixture
def trained(folder, capsys):
    """Run a training of one step on those pairs; what it prints. Gives torch its threads back."""
    threads = torch.get_num_threads()

    def trained(*words):
        more = ("--pairs", folder, "--minutes", "0.001", "--threads", "1")
        assert main([*map(str, (*words, *more))]) == 0
        return capsys.readouterr().out

    yield trained
    torch.set_num_threads(threads)


@pytest.fixture
def told(capsys):
    """What a command tells as JSON, where its exit code is ``code``."""

    def told(*words, code=0):
        capsys.readouterr()
        assert main([*map(str, words), "--json"]) == code
        return json.loads(capsys.readouterr().out)

    return told


@pytest.fixture
def refused_at_last(capsys):
    """As ``refused``, where lines of progress may stand before the one of the error."""

    def refused_at_last(*words):
        capsys.readouterr()
        assert main([str(word) for word in words]) == 2
        *_, error = capsys.readouterr().err.splitlines()
        assert error.startswith("error: ")
        return error

    return refused_at_last
