"""Servo a free camera to a goal image in the built-in room: servo_in_room.py [--seed N].

The whole closed loop in one process: render, match, servo, move. It needs dfvs-lab.
"""

import argparse

import cv2
import numpy as np

import dfvs
from dfvs_core.geometry.poses import pose_error, se3_exp
from dfvs_sim.render.renderer import Renderer
from dfvs_sim.scene import builtin_room_path
from dfvs_sim.scene.glb import load_glb
from dfvs_sim.viewpoints.sampling import sample_task

PERIOD_S = 0.1
MOST_FRAMES = 200


def main() -> int:
    """Exit code 0 if the goal was reached, else 1."""
    parser = argparse.ArgumentParser(description="Servo a free camera in a simulated room.")
    parser.add_argument("--seed", type=int, default=0, help="of the start and the goal")
    parser.add_argument("--model", default="dfvs-flow", help="matcher (default: %(default)s)")
    parser.add_argument("--out", default="servo.png", help="first view, last view and goal")
    arguments = parser.parse_args()

    renderer = Renderer(load_glb(builtin_room_path()))
    camera = dfvs.CameraModel.from_horizontal_fov(320, 240, fov_rad=1.3)
    task = sample_task(renderer, camera, np.random.default_rng(arguments.seed))
    goal = renderer.render(camera, task.T_world_goal, antialias=True).image
    at_once = dfvs.ServoConfig(response_s=0.0, yaw_response_s=0.0)
    servo = dfvs.Servo(dfvs.load_matcher(arguments.model), goal, camera, config=at_once)

    T_world_camera, views, is_reached = task.T_world_start, [], False
    for k in range(MOST_FRAMES):
        views.append(renderer.render(camera, T_world_camera, antialias=True).image)
        result = servo.step(views[-1], t_capture_ns=round(k * PERIOD_S * 1e9))
        distance_m, angle_rad = pose_error(T_world_camera, task.T_world_goal)
        is_reached = result.reached
        if is_reached or k % 5 == 0:
            print(
                f"{k * PERIOD_S:4.1f} s  {100.0 * distance_m:6.1f} cm  "
                f"{np.degrees(angle_rad):5.1f} deg  {result.status.name}"
            )
        if is_reached:
            break
        T_world_camera = T_world_camera @ se3_exp(result.velocity * PERIOD_S)
    if not cv2.imwrite(arguments.out, np.hstack([views[0], views[-1], goal])[:, :, ::-1]):
        parser.error(f"cannot write {arguments.out}")
    return 0 if is_reached else 1


if __name__ == "__main__":
    raise SystemExit(main())
