"""Another goal for a running service: operator, Zenoh, perception and gate as they fly."""

import cv2
import pytest
from loopback import free_endpoint
from test_check import TOPICS, camera_running, service_running, settings, views
from waiting import until

from dfvs_service import cli
from dfvs_service.settings.key_file import create_key
from dfvs_service.settings.runtime import RuntimeFolder

pytestmark = pytest.mark.serial

__all__ = ["views"]


def save(path, picture):
    cv2.imwrite(str(path), picture[:, :, ::-1])
    return str(path)


def test_a_signed_goal_is_looked_for_checked_and_then_waits_for_engaging(
    vehicle, key_file, views, tmp_path, capsys
):
    endpoint, log = free_endpoint(), RuntimeFolder(tmp_path).gate_log

    def order(*words):
        options = ["--key-file", str(key_file), "--vehicle", TOPICS.vehicle]
        options += ["--set", f"zenoh.listen=['{endpoint}']", "--timeout", "10"]
        return cli.main(["command", *words, *options])

    config = settings(vehicle.port, endpoint, engage="command", command_key_file=str(key_file))
    with (
        service_running(tmp_path, config, views[0]) as watch,
        camera_running(endpoint, views[0]) as camera,
    ):
        watch.wait("goal", ok=True, seconds=40.0)
        other = save(tmp_path / "other.png", views[1])
        assert order("goal", "--goal", other) == 0
        # The camera still shows the old goal: there is nothing of the new one to see.
        watch.wait("goal", ok=False)
        camera.picture = views[1]
        watch.wait("goal", ok=True)
        assert order("goal", "--goal", save(tmp_path / "big.png", views[0][:64])) == 0
        is_refused = until(lambda: "cannot be used" in watch.beat.cause, 30.0, 0.05)
        assert is_refused, (watch.beat, log.read_text()[-2000:])
        assert until(lambda: any("cannot be used" in line for line in watch.lines))
        assert not vehicle.events("setpoint")
        assert not vehicle.events("mode_command")
        create_key(tmp_path / "other-key")
        key_file.write_bytes((tmp_path / "other-key").read_bytes())
        assert order("goal", "--goal", other) == 1
        assert "wrong signature" in capsys.readouterr().out
        assert until(lambda: "rejected: wrong signature" in log.read_text())
