"""Settings and sidecars that went wrong: each is read, or refused in one line."""

import copy
import dataclasses
import io
import json
import math
import tomllib

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dfvs_core.errors import DfvsError
from dfvs_core.geometry.camera import CameraModel
from dfvs_core.messages.goal import GoalSidecar, Mount
from dfvs_core.messages.schema import dump
from dfvs_service import cli
from dfvs_service.settings.config import ServiceConfig, config_from_json, load_config
from dfvs_service.settings.config_text import toml_text

CAMERA = CameraModel.from_horizontal_fov(64, 48, 1.2)
FULL = load_config(
    None,
    {
        "camera.mount.pitch_deg": -10.0,
        "camera.width": 64,
        "camera.height": 48,
        "camera.horizontal_fov_deg": 70.0,
    },
)
SETTINGS = tomllib.loads(toml_text(FULL))
SIDECAR = json.loads(GoalSidecar(CAMERA, 0.1, 0.2, Mount(pitch_rad=0.3)).to_json())

odd_value = st.one_of(
    st.sampled_from(
        [math.nan, math.inf, -math.inf, -1, 0, 1e308, 2**70, True, "", "1", "auto", [], {}, [1.0]]
    ),
    st.floats(),
    st.integers(),
    st.text(max_size=8),
    st.lists(st.text(max_size=4), max_size=3),
    st.dictionaries(st.text(max_size=4), st.integers(), max_size=2),
)


def places(table, path=()):
    """Path of every key in a document, sections included."""
    for key, value in table.items():
        yield (*path, key)
        if isinstance(value, dict):
            yield from places(value, (*path, key))


def spoiled_key(draw, key):
    """A key with a typo, or with another unit."""
    at = draw(st.integers(0, max(len(key) - 1, 0)))
    return draw(
        st.sampled_from(
            [
                key[:at] + key[at + 1 :],
                key[:at] + "x" + key[at:],
                key.upper(),
                key.replace("_deg", "_rad"),
                key.replace("_rad", "_deg"),
                key.replace("_m", "_cm"),
                key.replace("_s", "_ms"),
                f"{key}.{key}",
            ]
        )
    )


@st.composite
def mutations(draw, document, most=3):
    """A document with up to so many things wrong in it."""
    document = copy.deepcopy(document)
    for _ in range(draw(st.integers(1, most))):
        *path, key = draw(st.sampled_from(list(places(document))))
        table = document
        for name in path:
            table = table[name]
        change = draw(st.sampled_from(["typo", "value", "negate", "gone", "moved", "nested"]))
        old = table[key]
        if change == "typo":
            table[spoiled_key(draw, key)] = table.pop(key)
        elif change == "gone":
            del table[key]
        elif change == "moved":
            document[key] = table.pop(key)
        elif change == "nested":
            table[key] = {key: old}
        elif change == "negate" and isinstance(old, int | float):
            table[key] = -old
        else:
            table[key] = draw(odd_value)
        if not document:
            return document
    return document


def numbers(value):
    """Every number in a dataclass."""
    if dataclasses.is_dataclass(value):
        value = dump(value)
    if isinstance(value, dict | list | tuple):
        for inner in value.values() if isinstance(value, dict) else value:
            yield from numbers(inner)
    elif isinstance(value, int | float):
        yield value


def toml(document):
    """TOML text of a document: inline tables and all."""
    return "\n".join(f"{_quoted(key)} = {_toml(value)}" for key, value in document.items())


def _quoted(text):
    return (
        '"' + "".join(c if c.isascii() and c.isalnum() else f"\\U{ord(c):08x}" for c in text) + '"'
    )


def _toml(value):
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return _quoted(value)
    if isinstance(value, dict):
        return "{" + ", ".join(f"{_quoted(k)} = {_toml(v)}" for k, v in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(_toml, value)) + "]"
    return repr(value)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("settings")


def read(make):
    """What ``make`` gives, or None where it refuses as it should: by one line."""
    try:
        return make()
    except DfvsError as error:
        text = str(error)
    assert text
    assert "\n" not in text
    return None


@settings(max_examples=100)
@given(mutations(SETTINGS))
def test_mutated_settings_are_valid_or_refused_in_one_line(folder, document):
    path = folder / "mutated.toml"
    path.write_text(toml(document), encoding="utf-8")
    assert tomllib.loads(path.read_text()).keys() == document.keys()
    config = read(lambda: load_config(path, {}))
    if config is None:
        return
    gate = config.gate_config()
    assert all(map(math.isfinite, numbers(config)))
    assert 0 < gate.velocity.horizontal_m_s <= 5.0
    assert 0 < gate.velocity.slew_m_s2 <= 5.0
    assert gate.timing.hold_ns > 0
    assert gate.max_engaged_ns > 0
    assert config_from_json(config.to_json()) == config


@settings(max_examples=30)
@given(st.data())
def test_damaged_text_is_valid_or_refused_in_one_line(folder, data):
    text = toml_text(FULL)
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(0, len(text)))
        more = data.draw(st.sampled_from(["", "\n", "[", "]", "=", '"', "\x00", "9", "é", "# "]))
        text = text[:at] + more + text[at + data.draw(st.integers(0, 3)) :]
    path = folder / "damaged.toml"
    path.write_text(text, encoding="utf-8")
    config = read(lambda: load_config(path, {}))
    assert config is None or isinstance(config, ServiceConfig)


@settings(max_examples=100)
@given(mutations(SIDECAR))
def test_mutated_sidecars_are_valid_or_refused_in_one_line(document):
    sidecar = read(lambda: GoalSidecar.from_json(json.dumps(document)))
    if sidecar is None:
        return
    assert all(map(math.isfinite, numbers(sidecar)))
    assert min(sidecar.camera.width, sidecar.camera.height) > 0
    assert np.isfinite(sidecar.mount.T_body_camera()).all()


@pytest.fixture(scope="module")
def goal(folder):
    path = folder / "goal.png"
    cv2.imwrite(str(path), np.random.default_rng(1).integers(0, 255, (48, 64, 3), np.uint8))
    return path


@settings(max_examples=30)
@given(
    st.one_of(
        st.tuples(mutations(SETTINGS, most=1), st.just(SIDECAR)),
        st.tuples(st.just(SETTINGS), mutations(SIDECAR, most=1)),
    )
)
def test_the_command_line_refuses_in_one_line_before_anything_starts(folder, goal, documents):
    """Exit code 2 and one line on stderr, or the settings are good: nothing in between."""
    service, sidecar = documents
    (folder / "cli.toml").write_text(toml(service), encoding="utf-8")
    goal.with_suffix(".json").write_text(json.dumps(sidecar))
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        started, said = [], io.StringIO()
        patch.setattr(cli, "fly", lambda *_: started.append("flight") or 0)
        patch.setattr(cli.sys, "stderr", said)
        code = cli.main(["--goal", str(goal), "--config", "cli.toml"])
    lines = said.getvalue().splitlines()
    if code == 0:
        assert started == ["flight"]
        assert all(line.startswith("warning: ") for line in lines)
        return
    assert code == 2
    assert started == []
    assert [line.startswith("error: ") for line in lines] == [True]
