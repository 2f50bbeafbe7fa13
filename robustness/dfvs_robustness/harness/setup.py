"""Setups of the service under test: settings, goal, camera and model."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from dfvs_common.goal_file import write_goal
from dfvs_core.geometry.camera import CameraModel
from dfvs_core.messages.frame import PixelFormat
from dfvs_core.messages.goal import GoalSidecar, Mount
from dfvs_robustness.harness import network
from dfvs_robustness.harness.camera import ScriptedCamera
from dfvs_robustness.harness.service import KEY
from dfvs_robustness.harness.wall import Pose, Wall, noise_texture, ramp_texture

CAMERA = CameraModel.from_horizontal_fov(network.WIDTH, network.HEIGHT, math.radians(75.0))

NO_RESPONSE_CHECK = "gate.response_s=0"
"""Setting of flights without the initial-response check."""

_CALM = (
    *("servo.depth='constant'", "servo.constant_depth_m=3.0", "flow.threads=1"),
    *("telemetry.state_hz=20", "telemetry.preview_hz=0", "telemetry.flow_hz=0"),
    *("limits.max_distance_m=1000", "limits.max_engaged_s=3600", "gate.hold_visual_s=3600"),
    *("gate.engage='command'", "black_box.enabled=false"),
)


@dataclass(frozen=True, slots=True)
class Setup:
    """What kind of service a case needs: ``settings`` are further ``--set`` words.

    ``model`` sees a wall with texture (JPEG); without one, the network that can misbehave sees the
    ramp (raw pixels).
    """

    model: str = ""
    settings: tuple[str, ...] = ()
    other_goal: bool = False
    """The goal image shows another wall."""
    mount: Mount = field(default_factory=Mount)
    """How the goal's sidecar says that the camera is mounted; it looks straight ahead."""
    via_router: bool = False
    """Service and camera meet through a Zenoh router."""

    def camera(
        self, rng: np.random.Generator, publish: Callable[[bytes, bytes], None]
    ) -> ScriptedCamera:
        """Camera before the wall; ``publish`` takes payload and attachment."""
        texture = noise_texture(np.random.default_rng(7)) if self.model else ramp_texture()
        pixel_format = PixelFormat.JPEG if self.model else PixelFormat.RGB8
        return ScriptedCamera(Wall(texture, CAMERA, rng), pixel_format, publish)

    def write_inputs(self, folder: Path, wall: Wall, rng: np.random.Generator) -> None:
        """Write goal image, sidecar and command key of the service."""
        if self.other_goal:
            wall = Wall(noise_texture(np.random.default_rng(8)), CAMERA, rng)
        sidecar = GoalSidecar(CAMERA, mount=self.mount)
        write_goal(folder / "goal.png", wall.render(Pose()), sidecar)
        (folder / "key").write_bytes(KEY)
        (folder / "key").chmod(0o600)

    def words(self, folder: Path, endpoint: str) -> list[str]:
        """Arguments of ``dfvs-service`` beside the vehicle's: goal, model and settings.

        ``endpoint`` is where the service listens, or the router that it connects to.
        """
        words = ["--goal", str(folder / "goal.png"), "--model", self._model_in(folder)]
        listen = f"zenoh.listen=['{endpoint}']"
        if self.via_router:
            words += ["--set", "zenoh.mode='client'"]
            listen = f"zenoh.connect=['{endpoint}']"
        key = f"gate.command_key_file='{folder / 'key'}'"
        for setting in (*_CALM, listen, key, *self.settings):
            words += ["--set", setting]
        return words

    def _model_in(self, folder: Path) -> str:
        if self.model:
            return self.model
        bundle = folder / "bundle"
        if not bundle.exists():
            network.write_bundle(bundle)
        return str(bundle)


TEXTURE = Setup("classical")
"""The classical matcher sees a wall with texture."""
