"""Camera poses in the scene from the vehicle's poses in its local frame."""

import time

from dfvs_core.errors import DfvsError
from dfvs_sim.demo.plan import FlightPlan
from dfvs_sim.ground.pose import PoseTracker
from dfvs_sim.viewpoints.poses import CameraPoses


class FlightError(DfvsError):
    """The flight could not be brought up."""


def anchored_poses(plan: FlightPlan, tracker: PoseTracker, height_m: float) -> CameraPoses:
    """Place the local frame so that the vehicle, now on the ground, climbs to the plan's start.

    Parameters
    ----------
    plan : FlightPlan
    tracker : PoseTracker
        Knows where the vehicle stands.
    height_m : float
        How far it will climb.

    Raises
    ------
    FlightError
        If the vehicle's pose is not known.
    """
    pose = tracker.pose_at(time.monotonic_ns())
    if pose is None:
        raise FlightError("the vehicle's pose is not known", "LOCAL_POSITION_NED and attitude")
    T_scene_local = plan.T_scene_local(pose.T_local_body(), height_m)
    return tracker.camera_poses(T_scene_local, plan.mount.T_body_camera())
