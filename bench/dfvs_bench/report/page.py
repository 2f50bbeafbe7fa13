"""Pieces of the report's HTML that its sections share, and its style."""

from __future__ import annotations

import base64
import html
from collections.abc import Iterable, Sequence

import cv2
import numpy as np

from dfvs_core.geometry.arrays import ImageArray
from dfvs_core.messages.image import encode_jpeg

STYLE = """
:root { --column: 27rem; --text: 1rem; --small: .72rem; }
body { font: var(--text)/1.45 "DejaVu Sans", Verdana, sans-serif; color: #222;
       margin: 2rem auto; max-width: 88rem; padding: 0 1rem; }
h1 { font-size: 1.5em; } h2 { font-size: 1.2em; margin-top: 2em; }
p { max-width: 56rem; }
table { display: block; overflow-x: auto; border-collapse: collapse; margin: 1em 0;
        font-size: .8em; font-variant-numeric: tabular-nums; }
th, td { padding: .2em .6em; text-align: right; vertical-align: top;
         border-bottom: 1px solid #ddd; }
th { vertical-align: bottom; } td { white-space: nowrap; }
th:first-child, td:first-child { text-align: left; white-space: normal; min-width: 9em; }
tr.paper td { color: #666; } td.nc { color: #b3362f; }
table.scenes { font-size: .68em; } table.scenes th, table.scenes td { padding: .2em .4em; }
figure { display: inline-block; vertical-align: top; width: var(--column);
         max-width: 100%; margin: .5em 1.2em 1em 0; break-inside: avoid; }
figcaption { font-weight: bold; font-size: .85em; margin-bottom: .3em; }
figure img { display: block; width: 100%; }
.panels { display: grid; grid-template-columns: repeat(4, 1fr); gap: .5em .4em;
          font-size: var(--small); line-height: 1.2; }
.panels > div { display: flex; flex-direction: column; justify-content: end;
                overflow-wrap: anywhere; }
.nc { color: #b3362f; }
@page { size: A4; margin: 14mm; }
@media print {
  :root { --column: 88mm; --text: 9pt; --small: 6pt; }
  body { margin: 0; padding: 0; max-width: none; }
  figure { margin: 0 2mm 3mm 0; }
  h2, h2 + p { break-after: avoid; }
  table { display: table; break-inside: avoid; font-size: 7pt; } table.scenes { font-size: 5.2pt; }
  table.scenes th, table.scenes td { padding: .2em .25em; }
  td { white-space: normal; }
}
"""
"""Of the page; a figure is as wide as one of two columns when it is printed."""

_JPEG_QUALITY = 88
_PANEL_PX = 200


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
