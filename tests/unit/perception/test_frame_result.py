"""Result of a frame, as telemetry publishes it."""

from dataclasses import replace

from still_pipeline import pipeline
from textured_wall import Wall, texture

from dfvs_core.messages.frame import Frame
from dfvs_core.perception.vehicle_history import Motion
from dfvs_service.perception.telemetry.messages import servo_document

PERIOD_NS = 40_000_000


def test_telemetry_publishes_the_state_of_the_goal_tracker(rng):
    image, other = (Wall(texture(rng)).picture() for _ in range(2))
    perception = pipeline(image, depth="constant")
    states, coasting = [], []
    for k, view in enumerate((image, image, other, other, other, image)):
        motion = replace(Motion.at_rest(0.0, 0.0), t_ns=k * PERIOD_NS)
        frame = Frame(view, k * PERIOD_NS, k)
        result = perception.process_frame(frame, motion, engaged=False)
        states.append(servo_document(frame, result, 0, {})["tracking"])
        coasting.append(result.is_coasting)
    assert states == ["tracking", "tracking", "coasting", "lost", "searching", "tracking"]
    assert coasting == [state == "coasting" for state in states]
