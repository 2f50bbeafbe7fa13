import asyncio
import json
import struct

import pytest

from dfvs_core.messages.link import GateStatus, VehicleState
from dfvs_core.messages.schema import dump
from dfvs_service.dashboard.hub import Hub
from dfvs_service.dashboard.outbox import ImageKind, Outbox
from dfvs_service.dashboard.vehicles.clock import Moment
from dfvs_service.dashboard.vehicles.sample import BrowserImage, Sample
from dfvs_service.dashboard.vehicles.vehicle_links import MAX_VEHICLES

TURNS = ((1, 1.7e308), (2, -1.7e308), (3, 0.5))
"""Stamps and yaw angles; from the first to the second there is no number."""


class Rig:
    def __init__(self):
        self.now = Moment(1_000_000_000, 5000.0)
        self.watched = []
        self.hub = Hub(lambda: self.now, self.watched.append)

    def state(self, vehicle, state="READY"):
        status = GateStatus(state, "tested", None, t_ns=self.now.t_ns)
        self.hub.on_samples([Sample(vehicle, "state", dump(status))])

    def picture(self, vehicle, kind=ImageKind.VIEW, stream="camera", data=b"jpeg"):
        self.hub.on_samples([Sample(vehicle, stream, BrowserImage(kind, self.now.t_ns, 1, data))])

    def browser(self, vehicle=None):
        outbox = Outbox()
        self.hub.join(outbox)
        if vehicle is not None:
            self.hub.watch(outbox, vehicle)
        return outbox


@pytest.fixture
def rig():
    return Rig()


def take(outbox):
    text, pictures = asyncio.run(asyncio.wait_for(outbox.next(), 0.5))
    return {} if text is None else json.loads(text), pictures


def test_vehicles_are_found_by_what_they_say(rig):
    rig.state("swift")
    rig.state("heron", "SERVO")
    news, _ = take(rig.browser())
    assert [(v["name"], v["state"]) for v in news["vehicles"]] == [
        ("heron", "SERVO"),
        ("swift", "READY"),
    ]


def test_a_browser_hears_of_the_vehicle_that_it_watches_and_of_no_other(rig):
    rig.state("swift")
    rig.state("heron")
    outbox = rig.browser("heron")
    take(outbox)
    rig.state("swift", "SERVO")
    rig.picture("swift")
    rig.state("heron", "HOLD")
    news, pictures = take(outbox)
    assert news["state"]["state"] == "HOLD"
    assert pictures == []


def test_who_begins_to_watch_is_told_everything_so_far(rig):
    rig.state("swift", "READY")
    rig.state("swift", "SERVO")
    rig.picture("swift", ImageKind.GOAL, "goal", b"goal")
    news, pictures = take(rig.browser("swift"))
    assert news["watching"] == "swift"
    assert news["state"]["state"] == "SERVO"
    assert [t["to"] for t in news["history"]["transitions"]] == ["READY", "SERVO"]
    assert [p[9:] for p in pictures] == [b"goal"]


def test_who_begins_to_watch_a_vehicle_that_fell_silent_gets_its_last_view_with_its_time(rig):
    rig.state("swift")
    rig.picture("swift", data=b"last")
    rig.now = Moment(61_000_000_000, 65_000.0)
    _, (view,) = take(rig.browser("swift"))
    assert view[9:] == b"last"
    assert struct.unpack_from("<d", view, 1)[0] == 5000.0


def test_a_kept_view_has_its_time_by_the_clock_that_was_set_since(rig):
    rig.picture("swift")
    rig.now = Moment(2_000_000_000, 9_000_000.0)
    _, (view,) = take(rig.browser("swift"))
    assert struct.unpack_from("<d", view, 1)[0] == 8_999_000.0


def test_pictures_are_asked_for_only_while_somebody_watches(rig):
    rig.state("swift")
    rig.state("heron")
    one, other = rig.browser("swift"), rig.browser("heron")
    assert rig.watched[-1] == {"swift", "heron"}
    rig.hub.leave(other)
    assert rig.watched[-1] == {"swift"}
    rig.hub.watch(one, "heron")
    assert rig.watched[-1] == {"heron"}
    rig.hub.leave(one)
    assert rig.watched[-1] == frozenset()


def test_all_browsers_share_one_encoding_of_a_picture(rig):
    rig.state("swift")
    outboxes = [rig.browser("swift") for _ in range(3)]
    rig.picture("swift")
    first, *others = [take(outbox)[1][0] for outbox in outboxes]
    assert all(other is first for other in others)


def test_a_vehicle_that_does_not_exist_cannot_be_watched(rig):
    rig.state("swift")
    rig.browser("ghost")
    assert rig.watched in ([], [frozenset()])


def test_a_vehicle_that_is_watched_already_is_not_told_from_the_start_again(rig):
    rig.state("swift")
    outbox = rig.browser("swift")
    take(outbox)
    rig.hub.watch(outbox, "swift")
    rig.state("swift", "HOLD")
    assert "history" not in take(outbox)[0]


def test_what_cannot_be_read_is_counted_and_harms_nobody(rig):
    rig.state("swift")
    outbox = rig.browser("swift")
    take(outbox)
    rig.hub.on_samples([Sample("swift", "state", {"state": 3}), Sample("swift", "servo", [])])
    assert rig.hub.refused == 2
    rig.state("swift", "HOLD")
    assert take(outbox)[0]["state"]["state"] == "HOLD"


def test_a_sample_that_raises_any_error_costs_itself_alone(rig):
    turned = [VehicleState(t, 0.0, 0.0, yaw, (0, 0, 0), (0, 0, 0)) for t, yaw in TURNS]
    states = [dump(GateStatus("SERVO", "tested", vehicle)) for vehicle in turned]
    rig.hub.on_samples([Sample("swift", "state", state) for state in states])
    assert rig.hub.refused == 1
    rows = rig.hub.model("swift").history(rig.now)["history"]["path"]
    assert [row[6] for row in rows] == [1.7e308, 0.5]


def test_a_flood_of_vehicles_is_cut_off(rig):
    for i in range(MAX_VEHICLES + 20):
        rig.state(f"v{i}")
    assert len(take(rig.browser())[0]["vehicles"]) == MAX_VEHICLES


def test_links_are_told_on_every_tick(rig):
    rig.state("swift")
    outbox = rig.browser("swift")
    take(outbox)
    rig.now = Moment(3_000_000_000, 7000.0)
    rig.hub.tick({"zenoh": {"connected": 1, "links": 1}})
    news, _ = take(outbox)
    assert news["link"]["streams"]["state"]["age_s"] == 2.0
    assert news["zenoh"]["connected"] == 1
