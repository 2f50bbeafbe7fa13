"""The systemd unit: systemd reads it without complaint, and what must be locked up is."""

import configparser
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from dfvs_service.config import BlackBoxSection, load_config

UNIT = Path(__file__).parents[3] / "deploy" / "dfvs-service.service"
ANALYZE = shutil.which("systemd-analyze")
LOCKED_UP = {
    "NoNewPrivileges": "yes",
    "ProtectSystem": "strict",
    "ProtectHome": "yes",
    "PrivateTmp": "yes",
    "CapabilityBoundingSet": "",
    "RestrictSUIDSGID": "yes",
    "IPAddressDeny": "any",
    "DevicePolicy": "closed",
    "LimitCORE": "0",
    "Restart": "no",
}


@pytest.fixture
def service():
    """Keys of the unit's [Service] section; of a repeated one the last."""
    parser = configparser.ConfigParser(strict=False, interpolation=None)
    parser.optionxform = str
    parser.read(UNIT)
    return dict(parser["Service"])


def test_it_runs_as_nobody_special_with_limits_and_a_watchdog(service):
    assert service["User"] not in ("", "root", "0")
    assert {key: service[key] for key in LOCKED_UP} == LOCKED_UP
    assert service["MemoryMax"]
    assert service["Type"] == "notify"
    assert float(service["WatchdogSec"]) <= 5


def test_the_black_box_has_a_folder_that_outlives_the_service_and_is_for_nobody_else(service):
    assert service["StateDirectory"] == "dfvs"
    assert service["StateDirectoryMode"] == "0700"
    # A folder of the settings file would lie where ProtectSystem lets nobody write.
    assert load_config(UNIT.parent / "service.toml", {}).black_box == BlackBoxSection()


def test_what_it_starts_is_what_the_command_line_knows(service):
    words = service["ExecStart"].split()
    assert Path(words[0]).name == "dfvs-service"
    options = [word for word in words if word.startswith("--")]
    command = [sys.executable, "-m", "dfvs_service.cli", "--help"]
    told = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    assert all(option in told for option in options)


@pytest.mark.skipif(ANALYZE is None, reason="systemd-analyze is not installed")
def test_systemd_finds_nothing_wrong_and_little_exposed(tmp_path):
    unit = tmp_path / UNIT.name
    # The program and the user exist where it is installed, not here.
    text = UNIT.read_text().replace("/opt/dfvs/bin/dfvs-service", sys.executable)
    unit.write_text(text)
    verified = subprocess.run(
        [ANALYZE, "verify", "--man=no", str(unit)], capture_output=True, text=True, check=False
    )
    assert (verified.returncode, verified.stderr) == (0, "")
    # 0 is nothing exposed, 10 everything; above 3 of it is refused.
    rated = subprocess.run(
        [ANALYZE, "security", "--offline=true", "--threshold=30", "--no-pager", str(unit)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert rated.returncode == 0, rated.stdout[-300:]
