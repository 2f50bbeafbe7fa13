"""``dfvs-camera`` as a process, with a subscriber where the service would be."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from loopback import listening_peer

from dfvs_core.geometry.camera import CameraModel
from dfvs_core.messages.frame import BOOT_ID_FILE, clock_identity, decode_frame, decode_header
from dfvs_core.messages.image import encode_png
from dfvs_core.messages.schema import parse
from dfvs_core.messages.topics import Topics
from dfvs_service.camera import cli
from dfvs_service.settings.calibration_file import write_calibration

TOPICS = Topics("filmed")
SIZE = (64, 48)
CAMERA = CameraModel(*SIZE, 50.0, 51.0, 32.5, 24.5, (0.1, -0.05, 0.001, 0.002))
TIMEOUT_S = 30


class Listener:
    """Listens where the service would, and keeps every frame."""

    def __init__(self, session, endpoint):
        self.endpoint = endpoint
        self.samples, self.calibrations = [], []
        self.frames = session.declare_subscriber(
            TOPICS.camera,
            lambda sample: self.samples.append(
                (sample.payload.to_bytes(), sample.attachment.to_bytes())
            ),
        )
        self.calibration = session.declare_subscriber(
            TOPICS.calibration,
            lambda sample: self.calibrations.append(json.loads(sample.payload.to_bytes())),
        )


@pytest.fixture
def listener():
    with listening_peer() as (session, endpoint):
        yield Listener(session, endpoint)


def camera(*words):
    command = [sys.executable, "-m", "dfvs_service.camera.cli", *map(str, words)]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def ended(process):
    out, err = process.communicate(timeout=TIMEOUT_S)
    return process.returncode, out, err


@pytest.fixture
def folder(tmp_path):
    """Pictures of flat grey, brighter and brighter."""
    for i in range(4):
        picture = np.full((SIZE[1], SIZE[0], 3), 40 * (i + 1), np.uint8)
        (tmp_path / f"{i}.png").write_bytes(encode_png(picture))
    return tmp_path


@pytest.mark.parametrize("pixels", ["jpeg", "raw"])
def test_pictures_arrive_as_perception_reads_them(listener, folder, pixels):
    calibration = folder / "camera.toml"
    write_calibration(calibration, CAMERA, ["made for a test"])
    words = ("--source", folder, "--loop", "--rate", 50, "--frames", 60, "--format", pixels)
    where = ("--vehicle", TOPICS.vehicle, "--connect", listener.endpoint)
    code, out, err = ended(camera(*words, *where, "--calibration", calibration, "--json"))
    assert code == 0, err
    assert json.loads(out)["frames"] == 60
    assert len(listener.samples) >= 4
    seen = []
    for payload, attachment in listener.samples:
        header = decode_header(attachment)
        assert header.clock == clock_identity(Path(BOOT_ID_FILE).read_text())
        frame = decode_frame(payload, header)
        assert frame.image.shape == (SIZE[1], SIZE[0], 3)
        seen.append((frame.seq, frame.t_capture_ns, round(float(frame.image.mean()) / 40)))
    seqs, times, levels = zip(*seen, strict=True)
    assert list(seqs) == sorted(set(seqs))
    assert list(times) == sorted(set(times))
    assert all(level == seq % 4 + 1 for seq, level in zip(seqs, levels, strict=True))
    assert parse(CameraModel, listener.calibrations[-1]) == CAMERA


def test_what_cannot_be_mended_by_waiting_ends_with_one_line(folder, tmp_path, refused):
    wrong = CameraModel(640, 480, 500.0, 500.0, 320.0, 240.0)
    write_calibration(tmp_path / "other.toml", wrong, [])
    assert "no source 'nothing'" in refused(cli.main, "--source", "nothing")
    assert "--rate is 0" in refused(cli.main, "--source", folder, "--rate", "0")
    assert "--size is 'big'" in refused(cli.main, "--source", folder, "--size", "big")
    words = ("--source", folder, "--calibration", tmp_path / "other.toml", "--size", "64x48")
    assert "640x480, the calibration's size" in refused(cli.main, *words)


def test_pictures_of_another_size_than_the_calibration_end_it(listener, folder, capsys):
    write_calibration(folder / "other.toml", CameraModel(640, 480, 5e2, 5e2, 320.0, 240.0), [])
    words = ("--source", folder, "--calibration", folder / "other.toml")
    assert cli.main([*map(str, words), "--connect", listener.endpoint]) == 2
    assert "64 x 48 px; expected 640 x 480 px" in capsys.readouterr().err.splitlines()[-1]


def test_a_camera_that_is_unplugged_is_waited_for(listener):
    process = camera("--source", "/dev/video97", "--connect", listener.endpoint)
    lines = []
    while not any("no camera /dev/video97" in line for line in lines):
        line = process.stderr.readline()
        assert line, lines
        lines.append(line)
    assert process.poll() is None
    process.terminate()
    assert ended(process)[0] == 0
    assert "trying again" in "".join(lines)


def test_a_camera_that_nobody_receives_ends_where_somebody_must(service, folder, capsys):
    words = ["--source", str(folder), "--loop", "--require-subscriber", "1"]
    assert cli.main([*words, "--connect", service[1], "--vehicle", TOPICS.vehicle]) == 2
    assert "nobody receives dfvs/filmed/camera" in capsys.readouterr().err.splitlines()[-1]


def test_a_camera_that_is_received_goes_on(listener, folder):
    words = ("--source", folder, "--loop", "--rate", 50, "--frames", 100)
    where = ("--vehicle", TOPICS.vehicle, "--connect", listener.endpoint)
    code, _, err = ended(camera(*words, *where, "--require-subscriber", "1"))
    assert code == 0, err
    assert "nobody receives" not in err
