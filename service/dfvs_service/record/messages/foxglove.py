"""Bytes of Foxglove's standard messages (protobuf). Times are Unix ns.

Frames: ``world`` has its z axis up, as Foxglove draws it; ``ned`` is the same origin north, east,
down; ``body`` is forward, right, down; ``camera`` is optical.
"""

from collections.abc import Sequence
from typing import Literal

import numpy as np
from foxglove_schemas_protobuf.CameraCalibration_pb2 import CameraCalibration
from foxglove_schemas_protobuf.Color_pb2 import Color
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.ImageAnnotations_pb2 import ImageAnnotations
from foxglove_schemas_protobuf.Log_pb2 import Log
from foxglove_schemas_protobuf.Point2_pb2 import Point2
from foxglove_schemas_protobuf.PointsAnnotation_pb2 import PointsAnnotation
from foxglove_schemas_protobuf.Pose_pb2 import Pose
from foxglove_schemas_protobuf.PoseInFrame_pb2 import PoseInFrame
from foxglove_schemas_protobuf.PosesInFrame_pb2 import PosesInFrame
from foxglove_schemas_protobuf.Quaternion_pb2 import Quaternion
from foxglove_schemas_protobuf.RawImage_pb2 import RawImage
from foxglove_schemas_protobuf.Vector3_pb2 import Vector3
from google.protobuf.timestamp_pb2 import Timestamp

from dfvs_core.geometry.arrays import FloatArray
from dfvs_core.geometry.camera import CameraModel
from dfvs_core.geometry.poses import quaternion_from_rotation, rotation_from_euler
from dfvs_core.messages.frame import FrameHeader, PixelFormat
from dfvs_core.messages.goal import Mount
from dfvs_core.messages.link import VehicleState
from dfvs_core.perception.flow_grid import FlowGrid

Entry = tuple[Literal["INFO", "WARNING", "ERROR"], str]
"""Severity, as Foxglove names its levels, and one line of a log."""

_HALF_PX = 0.5
"""Foxglove and ROS count pixels from the first one's centre, we from its corner."""

_RAW = {
    PixelFormat.RGB8: ("rgb8", 3),
    PixelFormat.BGR8: ("bgr8", 3),
    PixelFormat.MONO8: ("mono8", 1),
}
"""Encoding and bytes a pixel."""

_FLOW_STEP = 2
_FLOW_THICKNESS_PX = 1.0
_FLOW_COLOR = Color(r=0.2, g=0.9, b=0.4, a=0.9)

_R_WORLD_NED = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
"""North, east, down to east, north, up."""


def compressed_image(t_ns: int, frame: str, data: bytes, image_format: str) -> bytes:
    """``foxglove.CompressedImage`` of a JPEG or PNG."""
    message = CompressedImage(timestamp=_time(t_ns), frame_id=frame, data=data, format=image_format)
    return message.SerializeToString()


def raw_image(t_ns: int, data: bytes, header: FrameHeader) -> bytes:
    """``foxglove.RawImage`` of the camera's raw pixels."""
    encoding, bytes_per_px = _RAW[header.pixel_format]
    message = RawImage(
        timestamp=_time(t_ns),
        frame_id="camera",
        width=header.width,
        height=header.height,
        encoding=encoding,
        step=header.width * bytes_per_px,
        data=data,
    )
    return message.SerializeToString()


def calibration(t_ns: int, camera: CameraModel) -> bytes:
    """``foxglove.CameraCalibration`` of the camera that flies."""
    cx, cy = camera.cx - _HALF_PX, camera.cy - _HALF_PX
    rational = len(camera.distortion) > 5
    message = CameraCalibration(
        timestamp=_time(t_ns),
        frame_id="camera",
        width=camera.width,
        height=camera.height,
        distortion_model="rational_polynomial" if rational else "plumb_bob",
        D=camera.distortion or (0.0,) * 5,
        K=(camera.fx, 0.0, cx, 0.0, camera.fy, cy, 0.0, 0.0, 1.0),
        R=(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0),
        P=(camera.fx, 0.0, cx, 0.0, 0.0, camera.fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0),
    )
    return message.SerializeToString()


def flow_annotations(t_ns: int, grid: FlowGrid, min_confidence: float) -> bytes:
    """``foxglove.ImageAnnotations``: the confident flow to the goal, as lines on the image.

    Every second point of the grid is drawn, from the point to where the goal image shows it.
    """
    rows, columns = (np.arange(0, size, _FLOW_STEP) for size in grid.confidence.shape)
    v, u = np.meshgrid(rows, columns, indexing="ij")
    is_drawn = grid.confidence[v, u] >= min_confidence
    v, u = v[is_drawn], u[is_drawn]
    begins = np.stack((u, v), axis=-1) * grid.stride_px + grid.stride_px // 2 + _HALF_PX
    ends = begins + grid.flow[v, u]
    points = np.stack((begins, ends), axis=1).reshape(-1, 2).tolist()
    lines = PointsAnnotation(
        timestamp=_time(t_ns),
        type=PointsAnnotation.Type.LINE_LIST,
        points=[Point2(x=x, y=y) for x, y in points],
        outline_color=_FLOW_COLOR,
        thickness=_FLOW_THICKNESS_PX,
    )
    return ImageAnnotations(points=[lines]).SerializeToString()


def path(t_ns: int, positions_m: Sequence[tuple[float, float, float]]) -> bytes:
    """``foxglove.PosesInFrame`` of positions in the frame ``ned``."""
    upright = Quaternion(w=1.0)
    poses = [Pose(position=_vector(at), orientation=upright) for at in positions_m]
    message = PosesInFrame(timestamp=_time(t_ns), frame_id="ned", poses=poses)
    return message.SerializeToString()


def log(t_ns: int, name: str, entry: Entry) -> bytes:
    """``foxglove.Log`` of one line."""
    severity, text = entry
    level = Log.Level.Value(severity)
    message = Log(timestamp=_time(t_ns), level=level, name=name, message=text)
    return message.SerializeToString()


def pose(t_ns: int, vehicle: VehicleState) -> bytes:
    """``foxglove.PoseInFrame`` of the body, by the autopilot's position and attitude."""
    rotation = _quaternion(_R_ned_body(vehicle))
    message = PoseInFrame(
        timestamp=_time(t_ns),
        frame_id="ned",
        pose=Pose(position=_vector(vehicle.position_m), orientation=rotation),
    )
    return message.SerializeToString()


def body_transform(t_ns: int, vehicle: VehicleState) -> bytes:
    """``foxglove.FrameTransforms``: where the body is."""
    moving = _transform(t_ns, ("ned", "body"), _R_ned_body(vehicle), vehicle.position_m)
    return FrameTransforms(transforms=[moving]).SerializeToString()


def still_transforms(t_ns: int, mount: Mount) -> bytes:
    """``foxglove.FrameTransforms``: what does not move."""
    T_body_camera = mount.T_body_camera()
    lens = (mount.x_m, mount.y_m, mount.z_m)
    still = [
        _transform(t_ns, ("world", "ned"), _R_WORLD_NED, (0.0, 0.0, 0.0)),
        _transform(t_ns, ("body", "camera"), T_body_camera[:3, :3], lens),
    ]
    return FrameTransforms(transforms=still).SerializeToString()


def _R_ned_body(vehicle: VehicleState) -> FloatArray:
    return rotation_from_euler(vehicle.roll_rad, vehicle.pitch_rad, vehicle.yaw_rad)


def _transform(
    t_ns: int, frames: tuple[str, str], R: FloatArray, t_m: tuple[float, float, float]
) -> FrameTransform:
    parent, child = frames
    return FrameTransform(
        timestamp=_time(t_ns),
        parent_frame_id=parent,
        child_frame_id=child,
        translation=_vector(t_m),
        rotation=_quaternion(R),
    )


def _time(t_ns: int) -> Timestamp:
    seconds, nanos = divmod(t_ns, 1_000_000_000)
    return Timestamp(seconds=seconds, nanos=nanos)


def _vector(xyz: tuple[float, float, float]) -> Vector3:
    return Vector3(x=xyz[0], y=xyz[1], z=xyz[2])


def _quaternion(R: FloatArray) -> Quaternion:
    w, x, y, z = (float(v) for v in quaternion_from_rotation(R))
    return Quaternion(x=x, y=y, z=z, w=w)
