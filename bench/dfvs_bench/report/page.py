"""HTML of the report from its templates, and the images in it."""

import base64
import math
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

from dfvs_common.templates import templates
from dfvs_core.geometry.arrays import Float32Array, ImageArray
from dfvs_core.messages.image import encode_jpeg

_JPEG_QUALITY = 88
_PANEL_PX = 200


@dataclass(frozen=True, slots=True, eq=False)
class Panel:
    """An image (H, W, 3) RGB of a figure of several, with a title and a note of some class."""

    image: ImageArray
    title: str
    note: str = ""
    kind: str = ""


def render(name: str, **values: object) -> str:
    """HTML of a template of this folder."""
    environment = templates("dfvs_bench.report")
    environment.filters |= {"degrees": math.degrees, "svg_url": _svg_url, "jpeg_url": _jpeg_url}
    return environment.get_template(name).render(values)


def _svg_url(data: bytes) -> str:
    return f"data:image/svg+xml;base64,{base64.b64encode(data).decode()}"


def small(values: ImageArray | Float32Array) -> Any:
    """An image (H, W, ...) in the size in which it is printed."""
    height = round(_PANEL_PX * values.shape[0] / values.shape[1])
    return cv2.resize(values, (_PANEL_PX, height), interpolation=cv2.INTER_AREA)


def _jpeg_url(image: ImageArray) -> str:
    data = encode_jpeg(np.asarray(small(image), np.uint8), _JPEG_QUALITY)
    return f"data:image/jpeg;base64,{base64.b64encode(data).decode()}"
