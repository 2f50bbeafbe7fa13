"""Another goal for a running service: operator, Zenoh, perception and gate as they fly."""

import signal
import threading

import cv2
import pytest
from loopback import free_endpoint
from test_check import CAMERA, SIZE, TOPICS, Watch, camera_running, views
from waiting import until

from dfvs_core.messages.goal import Goal, GoalSidecar
from dfvs_service import cli
from dfvs_service.settings.config import load_config
from dfvs_service.settings.key_file import create_key
from dfvs_service.settings.runtime import RuntimeFolder
from dfvs_service.supervisor.parent import Parent, Programs, prepare_runtime

pytestmark = pytest.mark.serial

__all__ = ["views"]


class Service:
    """The real service in a thread of this process, taking orders."""

    def __init__(self, folder, mavlink_port, picture):
        self.endpoint, self.folder = free_endpoint(), folder
        create_key(folder / "key")
        overrides = {
            "vehicle.name": TOPICS.vehicle,
            "vehicle.mavlink": f"udpin://127.0.0.1:{mavlink_port}",
            "zenoh.listen": [self.endpoint],
            "gate.engage": "command",
            "gate.min_frame_hz": 5.0,  # however busy the machine is
            "gate.command_key_file": str(folder / "key"),
            "camera.timeout_s": 100,
        }
        sidecar = GoalSidecar(CAMERA)
        config, _ = load_config(None, overrides).with_camera(SIZE, sidecar)
        self.runtime = RuntimeFolder(folder)
        prepare_runtime(self.runtime, config, Goal(picture, sidecar))
        self.watch = Watch()
        self.parent = Parent(self.runtime, Programs(), self.watch)
        self.thread = threading.Thread(target=self.parent.run)
        self.thread.start()

    def end(self):
        self.parent.stop(signal.SIGTERM, None)
        self.thread.join(10.0)

    def order(self, *words):
        options = ["--key-file", str(self.folder / "key"), "--vehicle", TOPICS.vehicle]
        options += ["--set", f"zenoh.listen=['{self.endpoint}']", "--timeout", "10"]
        return cli.main(["command", *words, *options])

    def log(self):
        return self.runtime.gate_log.read_text() if self.runtime.gate_log.exists() else ""

    def wait(self, condition, seconds=30.0):
        assert until(condition, seconds, 0.05), (self.watch.beat, self.log()[-2000:])


def save(path, picture):
    cv2.imwrite(str(path), picture[:, :, ::-1])
    return str(path)


def test_a_signed_goal_is_looked_for_checked_and_then_waits_for_engaging(
    vehicle, views, tmp_path, capsys
):
    service = Service(tmp_path, vehicle.port, views[0])
    try:
        with camera_running(service.endpoint, views[0]) as camera:
            service.watch.wait("goal", ok=True, seconds=40.0)
            other = save(tmp_path / "other.png", views[1])
            assert service.order("goal", "--goal", other) == 0
            # The camera still shows the old goal: there is nothing of the new one to see.
            service.watch.wait("goal", ok=False)
            camera.picture = views[1]
            service.watch.wait("goal", ok=True)
            assert service.order("goal", "--goal", save(tmp_path / "big.png", views[0][:64])) == 0
            service.wait(lambda: "cannot be used" in service.watch.beat.cause)
            assert not vehicle.events("setpoint")
            assert not vehicle.events("mode_command")
            create_key(tmp_path / "other-key")
            (tmp_path / "key").write_bytes((tmp_path / "other-key").read_bytes())
            assert service.order("goal", "--goal", other) == 1
            assert "wrong signature" in capsys.readouterr().out
            assert "rejected: wrong signature" in service.log()
    finally:
        service.end()
