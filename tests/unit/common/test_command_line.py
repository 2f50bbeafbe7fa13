"""What options of several commands may say."""

import contextlib
import sys

import pytest

from dfvs_common.command_line import parse_size
from dfvs_common.lifecycle import run_command
from dfvs_core.errors import ConfigError


def test_a_size_is_width_and_height():
    assert parse_size("320x240") == parse_size("320X240") == (320, 240)


@pytest.mark.parametrize("text", ["", "320", "320x", "x240", "320x240x3", "-1x5", "0x240", "3.5x2"])
def test_what_is_no_size_is_refused_with_the_option(text):
    with pytest.raises(ConfigError, match=f"--camera is '{text}'"):
        parse_size(text, "--camera")


def test_an_error_of_the_system_is_one_line_with_the_file_and_exit_code_2(tmp_path, capsys):
    assert run_command(lambda: len((tmp_path / "none").read_bytes())) == 2
    assert capsys.readouterr().err == f"error: {tmp_path}/none: No such file or directory\n"


def test_an_error_that_cannot_be_printed_has_its_exit_code(tmp_path, monkeypatch):
    with open("/dev/full", "w", encoding="utf-8", buffering=1) as full:
        monkeypatch.setattr(sys, "stderr", full)
        assert run_command(lambda: len((tmp_path / "none").read_bytes())) == 2
        monkeypatch.undo()
        with contextlib.suppress(OSError):
            full.close()
