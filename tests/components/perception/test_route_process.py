"""Perception, as a process, on a route of two goals."""

import json
import queue

import pytest
from test_perception_process import CAMERA, TOPICS, Rig
from textured_wall import Wall, texture, turned

from dfvs_core.messages.goal import GoalSidecar
from dfvs_core.messages.image import encode_png
from dfvs_service.zenoh_session import subscribe_kept

pytestmark = pytest.mark.real_time


def test_the_next_goal_takes_over_in_sight_and_only_it_is_ever_reached(tmp_path, rng):
    wall = Wall(texture(rng))
    first, second = wall.picture(), wall.picture(turned(shift=(45.0, 0.0)))
    (tmp_path / "goal-0001.png").write_bytes(encode_png(second))
    (tmp_path / "goal-0001.json").write_text(GoalSidecar(CAMERA).to_json())
    with Rig(tmp_path, first) as rig:
        places = queue.Queue()
        listener = subscribe_kept(
            rig.session,
            TOPICS.telemetry("route"),
            lambda sample: places.put(json.loads(sample.payload.to_bytes())),
        )
        rig.report()
        # The camera shows the first goal: it is near at once, and reached for nobody.
        near = rig.shoot_until(rng, lambda r: r.healthy)
        assert near.error_m < 0.05
        assert not near.reached
        gone_on = rig.shoot_until(rng, lambda r: r.healthy and r.error_m > 0.3)
        assert not gone_on.reached
        rig.picture = second
        assert rig.shoot_until(rng, lambda r: r.reached).error_m < 0.05
        seen = [places.get(timeout=30.0) for _ in range(2)]
        assert [(place["goal"], place["of"]) for place in seen] == [(1, 2), (2, 2)]
        listener.undeclare()
