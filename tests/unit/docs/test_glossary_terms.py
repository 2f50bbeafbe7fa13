"""The glossary: no identifier has a word that a standard term replaced."""

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]

FOLDERS = (
    *("dfvs_core", "dfvs", "models", "common", "service"),
    *("sim", "export", "rooms", "bench", "robustness"),
)
"""Folders whose names are checked."""
MODULES = [
    path.relative_to(ROOT).as_posix()
    for folder in FOLDERS
    for path in (ROOT / folder).rglob("*.py")
]

# Words that are never right in an identifier. Words that are also standard English, or names of
# Python, NumPy, PX4 or Zenoh, are left out: turn, order, hold, watch, post, visit, only, take,
# look, mask, lease, follow, cold, warm, opening, trust, settle.
WORDS = {
    "besides": "exclude",
    "bring": "backward_warp",
    "courier": "async bridge",
    "crawl": "reduced speed",
    "doorkeeper": "middleware",
    "foretell": "predict",
    "furnish": "prepare",
    "glance": "observation",
    "glimpse": "preview",
    "heed": "on_<event>",
    "heard": "received",
    "hear": "receive",
    "hears": "subscribes",
    "lament": "report",
    "lesson": "decision of a route recording",
    "lifeline": "parent watchdog",
    "likeness": "matched texture, normalised cross-correlation",
    "merit": "score",
    "mistaken": "false goal",
    "narrator": "console writer",
    "nonsense": "implausible",
    "parcel": "sample",
    "picture": "image",
    "pictures": "image",
    "prepared": "features",
    "rival": "other commander",
    "rivals": "other commanders",
    "slim": "release",
    "spoil": "invalidate",
    "sure": "confident",
    "sureness": "confidence",
    "surer": "confident",
    "surest": "confident",
    "unsure": "not confident",
    "unwanted": "exclude",
}
# Whole names, where a single word would be too common.
NAMES = {
    "carry_on": "track",
    "closer_look": "multi-scale search",
    "first_decimetre": "initial motion",
    "first_match": "relocalise",
    "frame_guard": "FrameValidator",
    "landing_places": "forward splat",
    "let_go": "released",
    "looks_alike": "normalised_cross_correlation",
    "passing_over": "exclude",
    "setting_out": "initial motion",
    "stays_inside": "in-bounds mask",
    "turn_book": "recorder",
    "turn_feed": "record publisher",
}
KEPT = {
    # Keys of recordings: field names of ``FrameRecord``.
    ("dfvs_core/messages/frame_record.py", "heard"),
}


def words(name):
    """Words of an identifier, split at underscores and at camel case."""
    return [w.lower() for w in re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+", name)]


def identifiers(source):
    """Names that a module defines: classes, functions, parameters, variables, attributes."""
    for node in ast.walk(ast.parse(source)):
        match node:
            case ast.ClassDef() | ast.FunctionDef() | ast.AsyncFunctionDef():
                yield node.name
            case ast.arg():
                yield node.arg
            case ast.Name(ctx=ast.Store()):
                yield node.id
            case ast.Attribute(ctx=ast.Store()):
                yield node.attr
            case ast.alias(asname=str()):
                yield node.asname


def replaced(name):
    """Standard term in place of a name, empty where there is none."""
    parts = words(name)
    joined = f"_{'_'.join(parts)}_"
    for term, standard in NAMES.items():
        if f"_{term}_" in joined:
            return standard
    return next((WORDS[part] for part in parts if part in WORDS), "")


def test_no_identifier_has_a_replaced_term():
    found = {
        f"{path}: {name} -> {standard}"
        for path in MODULES
        for name in (Path(path).stem, *identifiers((ROOT / path).read_text(encoding="utf-8")))
        if (standard := replaced(name)) and (path, name) not in KEPT
    }
    assert sorted(found) == []


@pytest.mark.parametrize(
    ("name", "is_replaced"),
    [
        ("RivalEvent", True),
        ("_take_picture", True),
        ("MIN_LIKENESS", True),
        ("turnBookSize", True),
        ("measure", False),
        ("hearing_aid", False),
        ("image_turn", False),
    ],
)
def test_names_are_split_at_underscores_and_camel_case(name, is_replaced):
    assert bool(replaced(name)) is is_replaced
