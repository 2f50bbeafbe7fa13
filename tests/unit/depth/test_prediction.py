import numpy as np
from box_room import BoxRoom

from dfvs_core.depth.depth_map import DepthMap
from dfvs_core.depth.prediction import predict_flow
from dfvs_core.geometry.camera import CameraModel
from dfvs_core.geometry.poses import invert_pose, make_pose, rotation_from_euler

CAMERA = CameraModel.from_horizontal_fov(160, 120, 1.3)
ROOM = BoxRoom(CAMERA)


def test_exact_depth_and_motion_predict_the_exact_flow():
    T_a = make_pose(rotation_from_euler(0.1, 0.0, 0.3), np.array([0.2, 0.1, 0.0]))
    T_b = make_pose(rotation_from_euler(0.12, 0.02, 0.25), np.array([0.25, 0.2, 0.05]))
    grid = ROOM.depth(T_a)[4::8, 4::8].astype(np.float32)
    depth = DepthMap(grid, np.ones_like(grid))
    guess = predict_flow(CAMERA, depth, 8, invert_pose(T_b) @ T_a)
    exact = ROOM.flow(T_a, T_b)
    seen = exact.confidence > 0
    miss = np.linalg.norm(guess.flow - exact.flow, axis=2)[seen]
    # Between grid points the flow is interpolated, which costs a little at the room's edges.
    assert np.median(miss) < 0.1
    assert np.percentile(miss, 95) < 1.0
