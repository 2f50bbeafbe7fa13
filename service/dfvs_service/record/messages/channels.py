"""Channels of a recording: topic, encoding and schema for MCAP and Foxglove."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from foxglove_schemas_protobuf.CameraCalibration_pb2 import CameraCalibration
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.ImageAnnotations_pb2 import ImageAnnotations
from foxglove_schemas_protobuf.Log_pb2 import Log
from foxglove_schemas_protobuf.PoseInFrame_pb2 import PoseInFrame
from foxglove_schemas_protobuf.PosesInFrame_pb2 import PosesInFrame
from foxglove_schemas_protobuf.RawImage_pb2 import RawImage
from google.protobuf.message import Message as Protobuf
from mcap_protobuf.schema import build_file_descriptor_set


@dataclass(frozen=True, slots=True)
class Channel:
    """A topic and how its messages are written."""

    topic: str
    encoding: str
    schema_name: str = ""
    schema_encoding: str = ""
    schema: bytes = b""


@dataclass(frozen=True, slots=True)
class Message:
    """One message; ``t_unix_ns`` is when it became known, ``sequence`` its record's number."""

    channel: Channel
    t_unix_ns: int
    sequence: int
    data: bytes


def _foxglove(topic: str, message: type[Protobuf]) -> Channel:
    schema = build_file_descriptor_set(message).SerializeToString()
    return Channel(topic, "protobuf", message.DESCRIPTOR.full_name, "protobuf", schema)


COMPRESSED_IMAGE = _foxglove("/camera/image", CompressedImage)
RAW_IMAGE = _foxglove("/camera/image_raw", RawImage)
CALIBRATION = _foxglove("/camera/calibration", CameraCalibration)
GOAL_IMAGE = _foxglove("/goal/image", CompressedImage)
POSE = _foxglove("/vehicle/pose", PoseInFrame)
PATH = _foxglove("/vehicle/path", PosesInFrame)
FLOW = _foxglove("/camera/flow", ImageAnnotations)
GATE_LOG = _foxglove("/gate/log", Log)
TRANSFORMS = _foxglove("/tf", FrameTransforms)

SESSION_HEADER = Channel(
    "/dfvs/opening", "json", "dfvs.Opening", "jsonschema", b'{"type":"object"}'
)
FRAME_RECORD = Channel("/dfvs/turn", "json", "dfvs.Turn", "jsonschema", b'{"type":"object"}')
UNREADABLE = Channel("/dfvs/unreadable_sample", "application/octet-stream")


def json_channel(topic: str, name: str, example: Mapping[str, Any]) -> Channel:
    """Channel of JSON documents that look like the example; a null in it stands for a number."""
    schema = json.dumps(_schema_of(example), separators=(",", ":")).encode()
    return Channel(topic, "json", name, "jsonschema", schema)


def _schema_of(value: object) -> dict[str, Any]:
    if isinstance(value, Mapping):
        properties = {str(key): _schema_of(inner) for key, inner in value.items()}
        return {"type": "object", "properties": properties}
    if isinstance(value, list | tuple):
        return {"type": "array", "items": _schema_of(value[0]) if value else {}}
    if isinstance(value, bool):
        return {"type": "boolean"}
    return {"type": "string" if isinstance(value, str) else "number"}
