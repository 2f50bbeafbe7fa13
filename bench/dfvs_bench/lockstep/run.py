"""Many flights in simulated time, drawn from seeds."""

import numpy as np

from dfvs_bench.lockstep.exact import ExactMatcher
from dfvs_bench.lockstep.flight import CAMERA, EXACT, LockstepFlight, SimulatedJob
from dfvs_bench.lockstep.record import SimulatedFlight, simulated_flight
from dfvs_bench.trials.run import renderer_of
from dfvs_core.geometry.arrays import FloatArray, ImageArray
from dfvs_models.catalog import load_depth, load_matcher
from dfvs_sim.camera.sensor import SensorNoise
from dfvs_sim.render.renderer import Renderer
from dfvs_sim.viewpoints.sampling import Task, sample_task

_NOISE_PX = 0.3
_SENSOR_NOISE = 1.5


def fly(job: SimulatedJob) -> SimulatedFlight:
    """Fly one job to its end.

    Raises
    ------
    DfvsError
        If the scene or a model cannot be used.
    """
    renderer = renderer_of(job.scene)
    task = sample_task(renderer, CAMERA, np.random.default_rng(job.seed))
    return simulated_flight(job.seed, task.T_world_goal, _flight(job, task, renderer).run())


def _flight(job: SimulatedJob, task: Task, renderer: Renderer) -> LockstepFlight:
    rng = np.random.default_rng([job.seed, 1])
    noise = SensorNoise.make(CAMERA.size, _SENSOR_NOISE, rng)
    network = load_depth(job.depth, job.depth_model, 1)
    if job.matcher == EXACT:
        exact = ExactMatcher(renderer, CAMERA, _NOISE_PX, rng)
        grey = np.full((CAMERA.height, CAMERA.width, 3), 128, np.uint8)

        def render(T: FloatArray) -> ImageArray:
            exact.look_from(T)
            is_seen = network is not None and T is task.T_world_goal
            return noise.apply(renderer.render(CAMERA, T).image if is_seen else grey, rng)

        return LockstepFlight(job, task, exact, render, network)
    matcher = load_matcher(job.matcher, 1)
    return LockstepFlight(
        job, task, matcher, lambda T: noise.apply(renderer.render(CAMERA, T).image, rng), network
    )
