"""Recordings that cannot be made are refused in one line."""

import numpy as np
import pytest
from loopback import free_endpoint

from dfvs_core.messages.image import encode_png
from dfvs_service.cli import main as service_command
from dfvs_service.record.cli import main as record


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--out", "/proc/nowhere"], "/proc/nowhere cannot be made"),
        (["--out", "TMP", "--set", "record.max_file_mb=0"], "out of range"),
        (["recover", "nowhere.mcap"], "cannot read nowhere.mcap"),
    ],
)
def test_bad_words_are_one_clear_line(words, message, tmp_path, refused):
    words = [tmp_path if word == "TMP" else word for word in words]
    assert message in refused(record, *words)


def test_a_service_that_cannot_record_says_so_before_anything_starts(tmp_path, refused):
    goal = tmp_path / "goal.png"
    goal.write_bytes(encode_png(np.random.default_rng(0).integers(0, 255, (240, 320, 3), np.uint8)))
    listen = ("--set", f'zenoh.listen=["{free_endpoint()}"]')
    words = ("--goal", goal, "--camera-fov", "70", "--record", "/proc/nowhere", *listen)
    assert "/proc/nowhere cannot be made" in refused(service_command, *words)
