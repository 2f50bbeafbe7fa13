"""Working size of a flight: settled once, among the settings."""

import dataclasses
from itertools import count

import numpy as np
import pytest

from dfvs_core.geometry.camera import CameraModel
from dfvs_core.matching.matcher import ImageFeatures
from dfvs_core.messages.goal import Goal, GoalSidecar
from dfvs_service.perception.assembly import flow_matcher
from dfvs_service.perception.working_size import choose_working_width, with_working_size
from dfvs_service.replay.flight import Trial
from dfvs_service.settings.config import config_from_json, load_config

CAMERA = CameraModel.from_horizontal_fov(640, 480, 1.2)
GOAL = Goal(np.zeros((480, 640, 3), np.uint8), GoalSidecar(CAMERA))


MS = 1_000_000
READINGS = 12
"""Of the clock for one candidate: six frames."""


def clock_of(*durations_ms):
    """A clock by which each candidate's frames take so long, one candidate after the other."""
    readings = count()

    def tick():
        n = next(readings)
        return (n % 2) * durations_ms[n // READINGS] * MS

    return tick


def image(width, height):
    return np.zeros((height, width, 3), np.uint8)


@pytest.mark.parametrize(
    ("durations_ms", "width_px"),
    [
        ((26,), 192),
        ((20, 26), 256),
        ((20, 25, 26), 320),
        ((5, 10, 20, 25, 26), 480),
        ((5, 10, 15, 20, 25), 640),
    ],
)
def test_the_largest_size_that_fits_the_budget_is_taken(durations_ms, width_px):
    assert choose_working_width(image(1280, 720), 25 * MS, clock_of(*durations_ms)) == width_px


@pytest.mark.parametrize(
    ("size", "width_px"), [((320, 240), 320), ((160, 120), 192), ((424, 240), 400)]
)
def test_no_size_above_the_cameras_is_tried(size, width_px):
    assert choose_working_width(image(*size), 25 * MS, clock_of(1, 1, 1, 99)) == width_px


def settings(**flow):
    overrides = {"flow.model": "classical"} | {f"flow.{name}": v for name, v in flow.items()}
    return load_config(None, overrides).with_camera(CAMERA.size, GOAL.sidecar)[0]


def never():
    raise AssertionError("nothing was to be measured")


def test_what_was_measured_is_a_setting_by_which_the_processes_match():
    config = settings()
    settled = with_working_size(config, GOAL, flow_matcher(config.flow), lambda: 0)
    assert settled.flow.working_width_px == 640
    assert dataclasses.replace(settled, flow=config.flow) == config
    passed_on = config_from_json(settled.to_json())
    assert flow_matcher(passed_on.flow).encode(GOAL.image).size == (480, 640)


def test_a_size_that_is_set_is_not_measured():
    config = settings(working_width_px=400)
    assert with_working_size(config, GOAL, flow_matcher(config.flow), never) is config
    assert flow_matcher(config.flow).encode(GOAL.image).size == (300, 400)


def test_a_matcher_without_a_working_size_is_left_as_it_is():
    class Pair:
        def encode(self, image):
            return ImageFeatures(image.shape[:2])

    config = settings()
    assert with_working_size(config, GOAL, Pair(), never) is config


def test_settings_that_are_tried_in_a_replay_do_not_measure_anew():
    recorded, tried = settings(working_width_px=480), settings(threads=1)
    assert Trial(tried).applied_to(recorded).flow == dataclasses.replace(
        tried.flow, working_width_px=480
    )
    tried = settings(working_width_px=400)
    assert Trial(tried).applied_to(recorded).flow.working_width_px == 400
