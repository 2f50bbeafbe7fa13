"""The end of ``dfvs-sim`` with its processes."""

import argparse
import contextlib

import pytest

from dfvs_sim.commands import world


def processes(monkeypatch, **codes):
    """Stand-ins for the processes: codes while they run, and once they are ended by the world."""

    class Process(contextlib.AbstractContextManager):
        def __init__(self, name, _arguments):
            self.name = name
            self.exit_code, self._ended_code = codes[name]

        def __exit__(self, *_):
            if self.exit_code is None:
                self.exit_code = self._ended_code

    monkeypatch.setattr(world, "Child", Process)


@pytest.mark.parametrize(
    ("vehicle", "camera", "code", "told"),
    [
        ((-11, None), (None, 0), 1, "error: the vehicle was killed by SIGSEGV\n"),
        ((None, 0), (-9, None), 1, "error: the camera was killed by SIGKILL\n"),
        ((-11, None), (2, None), 1, "error: the vehicle was killed by SIGSEGV\n"),
        ((2, None), (None, 143), 2, ""),
        ((0, None), (None, 143), 0, ""),
        ((0, None), (None, -9), 0, ""),
    ],
)
def test_a_crash_is_told_and_a_failure(vehicle, camera, code, told, monkeypatch, capsys):
    processes(monkeypatch, vehicle=vehicle, camera=camera)
    assert world.run(argparse.Namespace()) == code
    assert capsys.readouterr().err == told
