"""Pieces of the report's HTML that its sections share."""

from __future__ import annotations

import base64
import html
from collections.abc import Iterable, Sequence


def embedded(data: bytes, kind: str, width_px: int) -> str:
    """A picture inside the page itself; ``kind`` is png or jpeg."""
    text = base64.b64encode(data).decode()
    return f"<img width='{width_px}' alt='' src='data:image/{kind};base64,{text}'>"


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table of plain texts."""
    first = "<tr>" + "".join(f"<th>{html.escape(text)}" for text in head)
    others = ("<tr>" + "".join(f"<td>{html.escape(text)}" for text in row) for row in rows)
    return f"<table>{first}{''.join(others)}</table>"
