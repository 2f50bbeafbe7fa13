"""Many flights in simulated time, drawn from seeds."""

import math
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from dfvs_bench.lockstep.exact import ExactMatcher
from dfvs_bench.lockstep.flight import LockstepFlight, LockstepSetup
from dfvs_bench.lockstep.record import SimulatedFlight, simulated_flight
from dfvs_core.gate.config import Engage, GateConfig, OnDone, S
from dfvs_core.gate.limits import VelocityLimits
from dfvs_core.geometry.arrays import FloatArray, ImageArray
from dfvs_core.geometry.camera import CameraModel
from dfvs_core.messages.goal import Mount
from dfvs_core.servo.config import DepthChoice, ServoConfig
from dfvs_models import DEFAULT_DEPTH
from dfvs_models.catalog import load_depth, load_matcher
from dfvs_sim.camera.sensor import SensorNoise
from dfvs_sim.render.renderer import Renderer
from dfvs_sim.scene.glb import load_glb
from dfvs_sim.vehicle.motion.flight import VehicleConfig
from dfvs_sim.viewpoints.sampling import sample_task

EXACT = "exact"
"""Correspondences by the renderer's depth, with noise."""

_NOISE_PX = 0.3
_SENSOR_NOISE = 1.5
_FOV_RAD = math.radians(75.0)
_HOLD_MARGIN_S = 60.0


@dataclass(frozen=True, slots=True)
class SimulatedJob:
    """One flight of a run; picklable.

    ``matcher`` is ``exact`` or a name that ``dfvs-service`` knows. ``mounted_deg`` is how far about
    the vertical the camera is mounted from what the settings say; ``hold_s`` how long the goal is
    held after DONE. ``limits`` are the gate's, whose horizontal speed the servo law takes too.
    ``depth`` is ``servo.depth``, ``depth_model`` the bundle that it may need.
    """

    seed: int
    scene: Path
    vehicle: VehicleConfig
    matcher: str = EXACT
    size: tuple[int, int] = (320, 240)
    rate_hz: float = 15.0
    timeout_s: float = 60.0
    hold_s: float = 5.0
    mounted_deg: float = 0.0
    limits: VelocityLimits = field(default_factory=VelocityLimits)
    depth: DepthChoice = "motion"
    depth_model: str = DEFAULT_DEPTH


def fly(job: SimulatedJob) -> SimulatedFlight:
    """Fly one job to its end.

    Raises
    ------
    DfvsError
        If the scene or a model cannot be used.
    """
    renderer = Renderer(load_glb(job.scene))
    camera = CameraModel.from_horizontal_fov(*job.size, _FOV_RAD)
    task = sample_task(renderer, camera, np.random.default_rng(job.seed))
    gate = GateConfig(
        velocity=job.limits,
        engage=Engage.AUTO,
        on_done=OnDone.HOLD_VISUAL,
        hold_visual_ns=round((job.hold_s + _HOLD_MARGIN_S) * S),
    )
    setup = LockstepSetup(
        camera,
        task.T_world_start,
        task.T_world_goal,
        vehicle=job.vehicle,
        servo=ServoConfig(depth=job.depth, max_horizontal_m_s=job.limits.horizontal_m_s),
        gate=gate,
        mounted=Mount(yaw_rad=math.radians(job.mounted_deg)) if job.mounted_deg else None,
        rate_hz=job.rate_hz,
        timeout_s=job.timeout_s,
        after_s=job.hold_s,
        seed=job.seed,
    )
    flight = _flight(job, setup, renderer)
    return simulated_flight(job.seed, flight, flight.run())


def _flight(job: SimulatedJob, setup: LockstepSetup, renderer: Renderer) -> LockstepFlight:
    camera, rng = setup.camera, np.random.default_rng([job.seed, 1])
    noise = SensorNoise.make(camera.size, _SENSOR_NOISE, rng)
    network = load_depth(job.depth, job.depth_model, 1)
    if job.matcher == EXACT:
        exact = ExactMatcher(renderer, camera, _NOISE_PX, rng)
        grey = np.full((camera.height, camera.width, 3), 128, np.uint8)

        def render(T: FloatArray) -> ImageArray:
            is_seen = network is not None and T is setup.T_scene_goal
            return noise.apply(renderer.render(camera, T).image if is_seen else grey, rng)

        return LockstepFlight(setup, exact, render, exact.look_from, network)
    matcher = load_matcher(job.matcher, 1)
    return LockstepFlight(
        setup, matcher, lambda T: noise.apply(renderer.render(camera, T).image, rng), depth=network
    )
