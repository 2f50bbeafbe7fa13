"""Assembly of perception from settings, for a flight and for its replay."""

import os
from collections.abc import Callable
from dataclasses import dataclass, replace

from dfvs_core.depth.network import DepthEstimator
from dfvs_core.matching.config import MatchingConfig
from dfvs_core.matching.matcher import Matcher
from dfvs_core.messages.goal import Goal, Mount
from dfvs_core.perception.pipeline import Pipeline
from dfvs_core.servo.task import ServoTask
from dfvs_models.catalog import depth_files, load_depth, load_matcher, model_files
from dfvs_models.depth import DepthNetwork
from dfvs_service.perception.frame_processor import FrameProcessor
from dfvs_service.settings.config import ServiceConfig
from dfvs_service.settings.sections import FlowSection
from dfvs_service.settings.state_folder import engine_cache


@dataclass(frozen=True, slots=True)
class Clocks:
    """Where perception reads the time: monotonic ns, of the clock with the identity ``identity``.

    ``validation`` is read when a frame is validated, ``servo`` in the pipeline. In flight both are
    the same; a replay puts recorded times into either.
    """

    identity: bytes
    validation: Callable[[], int]
    servo: Callable[[], int]


def flow_matcher(flow: FlowSection) -> Matcher:
    """Matcher of the settings; without a working width, at the default one.

    Raises
    ------
    ModelError
        If there is no such model or provider, or it cannot be used.
    """
    config = MatchingConfig()
    if flow.working_width_px > 0:
        config = replace(config, working_width_px=flow.working_width_px)
    cache = engine_cache(os.environ)
    return load_matcher(flow.model, flow.threads, flow.provider, config, cache)


def servo_task(config: ServiceConfig, goal: Goal) -> ServoTask:
    """What stays the same on the way to a goal, with resolved settings."""
    camera = config.camera.model() or goal.sidecar.camera
    return ServoTask(config.servo, camera, goal.sidecar, config.camera.mount or Mount())


def depth_network(config: ServiceConfig) -> DepthNetwork | None:
    """Depth network that the settings ask for; None where they ask for none.

    Raises
    ------
    ModelError
        If there is no such bundle, or it cannot be used.
    """
    flow, cache = config.flow, engine_cache(os.environ)
    return load_depth(config.servo.depth, config.depth.model, flow.threads, flow.provider, cache)


def perception_files(config: ServiceConfig) -> dict[str, str]:
    """SHA-256 of every file of the models that perception works by, by name.

    Raises
    ------
    ModelError
        If they cannot be read.
    """
    depth = depth_files(config.servo.depth, config.depth.model)
    return model_files(config.flow.model) | depth


def build_frame_processor(
    config: ServiceConfig,
    goal: Goal,
    matcher: Matcher,
    clocks: Clocks,
    depth: DepthEstimator | None = None,
) -> FrameProcessor:
    """Perception of a goal, with resolved settings; ``depth`` is theirs (:func:`depth_network`)."""
    task = servo_task(config, goal)
    pipeline = Pipeline(task, matcher, goal, clocks.servo, depth)
    return FrameProcessor(task.camera, pipeline, clocks.identity, clocks.validation)
