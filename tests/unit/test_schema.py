from dataclasses import dataclass, field
from enum import Enum
from typing import Literal

import pytest

from dfvs_core.errors import ConfigError
from dfvs_core.messages.schema import dump, parse, setting, with_present_names


class Colour(Enum):
    RED = "red"
    BLUE = "blue"


@dataclass(frozen=True)
class Inner:
    gain: float = setting(0.5, "gain", low=0.0, high=2.0)
    names: tuple[str, ...] = ()


@dataclass(frozen=True)
class Outer:
    count: int
    inner: Inner = field(default_factory=Inner)
    colour: Colour = Colour.RED
    mode: Literal["peer", "client"] = "peer"
    pair: tuple[int, float] = (1, 2.0)
    maybe: float | None = None
    table: dict[str, int] = field(default_factory=dict)
    on: bool = False


def test_a_dumped_document_parses_to_the_same_value():
    value = Outer(3, Inner(1.0, ("a",)), Colour.BLUE, "client", (4, 5.0), 6.0, {"x": 7}, True)
    assert parse(Outer, dump(value)) == value


def test_an_integer_beyond_all_floats_is_refused_where_a_float_is_wanted():
    with pytest.raises(ConfigError, match="a finite number"):
        parse(Outer, {"count": 1, "maybe": 10**400})


@dataclass(frozen=True)
class Renamed:
    strength: float = setting(0.5, "strength", formerly="gaim")
    gain: float = setting(0.5, "gain")


def test_a_former_name_is_refused_with_the_present_one_and_not_with_the_nearest():
    with pytest.raises(ConfigError, match=r"unknown key 'gaim'.*did you mean 'strength'\?"):
        parse(Renamed, {"gaim": 1.0})
    with pytest.raises(ConfigError, match=r"did you mean 'gain'\?"):
        parse(Renamed, {"gaip": 1.0})


@dataclass(frozen=True)
class WithRenamed:
    part: Renamed | None = None


def test_a_recorded_mapping_gets_the_present_names_at_every_depth():
    recorded = {"part": {"gaim": 0.1, "gain": 0.2}}
    present = with_present_names(WithRenamed, recorded)
    assert parse(WithRenamed, present) == WithRenamed(Renamed(0.1, 0.2))
    assert with_present_names(WithRenamed, {"part": None}) == {"part": None}


def test_integers_serve_as_floats_but_not_the_other_way_round():
    assert parse(Outer, {"count": 1, "maybe": 2}).maybe == 2.0
    with pytest.raises(ConfigError, match="count"):
        parse(Outer, {"count": 1.0})


@pytest.mark.parametrize(
    ("data", "message"),
    [
        ({}, "'count' is missing"),
        ({"count": 1, "inner": {"gian": 1}}, "unknown key 'inner.gian'.*did you mean 'gain'"),
        ({"count": 1, "inner": {"gain": 3.0}}, "inner.gain = 3.0 is out of range.*0 to 2"),
        ({"count": 1, "inner": {"gain": float("nan")}}, "finite"),
        ({"count": True}, "count = True; expected a whole number"),
        ({"count": 1, "on": 1}, "on = 1; expected true or false"),
        ({"count": 1, "colour": "bleu"}, "did you mean 'blue'"),
        ({"count": 1, "mode": "router"}, "one of 'peer', 'client'"),
        ({"count": 1, "pair": [1]}, "1 values"),
        ({"count": 1, "pair": "xy"}, "a list"),
        ({"count": 1, "inner": {"names": [1]}}, r"inner.names\[0\] = 1; expected a text"),
        ({"count": 1, "inner": 5}, "inner is 5"),
        ({"count": 1, "table": {"x": "y"}}, "table.x = 'y'; expected a whole number"),
        ([], "a table of keys"),
    ],
)
def test_what_does_not_follow_the_schema_is_named(data, message):
    with pytest.raises(ConfigError, match=message):
        parse(Outer, data)
