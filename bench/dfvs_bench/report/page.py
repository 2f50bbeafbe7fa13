"""Pieces of the report's HTML that its sections share, and its style."""

from __future__ import annotations

import base64
import html
from collections.abc import Iterable, Sequence
from pathlib import Path

import cv2
import numpy as np

from dfvs_core.geometry.arrays import ImageArray
from dfvs_core.messages.image import encode_jpeg

_STYLE = Path(__file__).with_name("page.css")
_JPEG_QUALITY = 88
_PANEL_PX = 200


def style() -> str:
    """Style sheet of the page."""
    return _STYLE.read_text(encoding="utf-8")


def embedded(data: bytes, kind: str) -> str:
    """An image inside the page itself; ``kind`` is svg+xml, png or jpeg."""
    text = base64.b64encode(data).decode()
    return f"<img alt='' src='data:image/{kind};base64,{text}'>"


def figure(caption: str, body: str) -> str:
    """A figure of one column's width; ``body`` is HTML."""
    return f"<figure><figcaption>{html.escape(caption)}</figcaption>{body}</figure>"


def panel(image: ImageArray, title: str, note: str = "", kind: str = "") -> str:
    """An image (H, W, 3) RGB of a figure of several, with a title and a note of some class."""
    height = round(_PANEL_PX * image.shape[0] / image.shape[1])
    small = cv2.resize(image, (_PANEL_PX, height), interpolation=cv2.INTER_AREA)
    shown = embedded(encode_jpeg(np.asarray(small, np.uint8), _JPEG_QUALITY), "jpeg")
    below = f"<span class='{kind}'>{html.escape(note)}&nbsp;</span>"
    return f"<div>{html.escape(title)}{shown}{below}</div>"


def panels(parts: Iterable[str]) -> str:
    """Several panels in rows of four."""
    return f"<div class='panels'>{''.join(parts)}</div>"


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table of plain texts."""
    first = "<tr>" + "".join(f"<th>{html.escape(text)}" for text in head)
    others = ("<tr>" + "".join(f"<td>{html.escape(text)}" for text in row) for row in rows)
    return f"<table>{first}{''.join(others)}</table>"
