"""The systemd units: systemd reads them without complaint, and what must be locked up is."""

import configparser
import re
import shutil
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

from dfvs_core.gate.config import GateTiming
from dfvs_service.settings.config import load_config
from dfvs_service.settings.record_sections import BlackBoxSection

DEPLOY = Path(__file__).parents[3] / "deploy"
NAMES = ("service", "camera", "dashboard", "metrics")
MODULES = {
    "dfvs-service": "dfvs_service.cli",
    "dfvs-camera": "dfvs_service.camera.cli",
    "dfvs-dashboard": "dfvs_service.dashboard.cli",
    "dfvs-metrics": "dfvs_service.live.metrics_cli",
}
ANALYZE = shutil.which("systemd-analyze")
needs_systemd = pytest.mark.skipif(ANALYZE is None, reason="systemd-analyze is not installed")
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
}


def unit_file(name):
    return DEPLOY / f"dfvs-{name}.service"


def section(name):
    """Keys of the unit's [Service] section; of a repeated one the last."""
    parser = configparser.ConfigParser(strict=False, interpolation=None)
    parser.optionxform = str
    parser.read(unit_file(name))
    return dict(parser["Service"])


@pytest.fixture
def service():
    return section("service")


@pytest.mark.parametrize("name", NAMES)
def test_it_runs_as_nobody_special_with_limits(name):
    keys = section(name)
    assert keys.get("DynamicUser") == "yes" or keys["User"] not in ("", "root", "0")
    assert {key: keys[key] for key in LOCKED_UP} == LOCKED_UP
    assert keys["MemoryMax"]


def test_the_service_has_a_watchdog_and_never_comes_back_by_itself(service):
    assert service["Type"] == "notify"
    assert float(service["WatchdogSec"]) <= 5
    assert service["Restart"] == "no"


def test_a_camera_that_comes_back_finds_no_flight_that_still_waits_for_it():
    assert float(section("camera")["RestartSec"]) > GateTiming().hold_ns * 1e-9


def test_the_documented_checks_keep_engines_where_the_service_finds_them(service):
    text = (DEPLOY.parent / "docs" / "how-to" / "install.md").read_text(encoding="utf-8")
    checks = [line for line in text.splitlines() if line.endswith(" --check")]
    folder = f"STATE_DIRECTORY=/var/lib/{service['StateDirectory']} "
    assert checks
    assert all(folder in line for line in checks)


@pytest.mark.parametrize("name", ["dashboard", "metrics"])
def test_who_only_shows_has_no_device_and_cannot_read_the_keys(name):
    keys = section(name)
    assert keys["DynamicUser"] == keys["PrivateDevices"] == "yes"
    assert not any(line.startswith("DeviceAllow") for line in unit_file(name).read_text().split())
    given, path = keys["LoadCredential"].split(":")
    assert path == "/etc/dfvs/service.toml"
    assert keys["ExecStart"].endswith("--config ${CREDENTIALS_DIRECTORY}/" + given)


def test_the_black_box_has_a_folder_that_outlives_the_service_and_is_for_nobody_else(service):
    assert service["StateDirectory"] == "dfvs"
    assert service["StateDirectoryMode"] == "0700"
    # A folder of the settings file would lie where ProtectSystem lets nobody write.
    assert load_config(DEPLOY / "service.toml", {}).black_box == BlackBoxSection()


@pytest.mark.parametrize("name", NAMES)
def test_what_it_starts_is_what_the_command_line_knows(name):
    words = section(name)["ExecStart"].split()
    program = Path(words[0]).name
    assert program == f"dfvs-{name}"
    options = [word for word in words if word.startswith("--")]
    command = [sys.executable, "-m", MODULES[program], "--help"]
    told = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    assert all(option in told for option in options)


def test_the_install_steps_name_files_that_exist():
    text = (DEPLOY.parent / "docs" / "how-to" / "install.md").read_text(encoding="utf-8")
    named = set(re.findall(r"deploy/[\w.-]+", text))
    assert {f"deploy/dfvs-{name}.service" for name in NAMES} <= named
    assert all((DEPLOY.parent / path).exists() for path in named)


def copied(name, folder):
    """The unit with a program that exists here."""
    unit = folder / unit_file(name).name
    text = unit_file(name).read_text()
    unit.write_text(text.replace(f"/opt/dfvs/bin/dfvs-{name}", sys.executable))
    return unit


def with_drop_in(unit, text):
    """The unit with a drop-in of this text."""
    folder = unit.with_name(f"{unit.name}.d")
    folder.mkdir(exist_ok=True)
    (folder / "drop-in.conf").write_text(text)
    return unit


def drop_in_of(page):
    """The one drop-in that a how-to shows."""
    text = (DEPLOY.parent / "docs" / "how-to" / page).read_text()
    (drop_in,) = re.findall(r"```ini\n(.*?)```", text, re.DOTALL)
    return textwrap.dedent(drop_in)


def verify(unit):
    command = [ANALYZE, "verify", "--man=no", str(unit)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")


@needs_systemd
@pytest.mark.parametrize("name", NAMES)
def test_systemd_finds_nothing_wrong_and_little_exposed(name, tmp_path):
    unit = copied(name, tmp_path)
    verify(unit)
    # 0 is nothing exposed, 10 everything; above 3 of it is refused.
    rated = subprocess.run(
        [ANALYZE, "security", "--offline=true", "--threshold=30", "--no-pager", str(unit)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert rated.returncode == 0, rated.stdout[-300:]


@needs_systemd
def test_systemd_reads_the_drop_in_for_certificates(tmp_path):
    verify(with_drop_in(copied("dashboard", tmp_path), drop_in_of("install.md")))


@needs_systemd
def test_systemd_reads_the_drop_in_for_a_pi_camera_which_opens_its_buffers(tmp_path):
    drop_in = drop_in_of("raspberry-pi.md")
    assert "DeviceAllow=char-dma_heap rw" in drop_in.splitlines()
    program = "/opt/dfvs/bin/dfvs-camera"
    assert program in drop_in
    verify(with_drop_in(copied("camera", tmp_path), drop_in.replace(program, sys.executable)))


def test_the_drop_in_of_a_jetson_opens_the_uarts_of_its_pins():
    assert "DeviceAllow=char-ttyTHS rw" in (DEPLOY / "jetson.conf").read_text().splitlines()


@needs_systemd
def test_systemd_reads_the_drop_in_of_a_jetson(tmp_path):
    unit, text = copied("service", tmp_path), (DEPLOY / "jetson.conf").read_text()
    verify(with_drop_in(unit, text))
    minutes_s = re.search(r"^TimeoutStartSec=(\d+)$", text, re.M)
    assert int(minutes_s[1]) >= 600  # TensorRT builds its engines
    with pytest.raises(AssertionError):
        verify(with_drop_in(unit, "[Service]\nDeviceAllow=char-nvgpu* maybe\n"))
