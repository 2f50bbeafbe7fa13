"""Whom the ground-station link listens to, and how it shows the vehicle's texts."""

import time
from typing import Any

import pytest
from autopilot_socket import Autopilot
from pymavlink.dialects.v20 import development as mavlink
from waiting import until

from dfvs_sim.ground.link import GroundLink
from dfvs_sim.ground.systems import LinkError


def text(words: str, number: int = 0, chunk: int = 0) -> Any:
    return mavlink.MAVLink_statustext_message(6, words.encode(), number, chunk)


def test_the_only_vehicle_on_the_link_is_ours(link: GroundLink, autopilot: Autopilot) -> None:
    autopilot.beat()
    link.wait_for_vehicle(20.0)
    assert link.target == 7


def test_two_vehicles_are_an_error_that_names_both(link: GroundLink, autopilot: Autopilot) -> None:
    with Autopilot(3, link.port) as second:
        autopilot.beat()
        second.beat()
        with pytest.raises(LinkError, match="3 and 7"):
            link.wait_for_vehicle(20.0)


def test_a_system_id_tells_two_vehicles_apart() -> None:
    with (
        GroundLink("udpin://127.0.0.1:0", system_id=3) as link,
        Autopilot(7, link.port) as first,
        Autopilot(3, link.port) as second,
    ):
        first.beat()
        second.beat()
        link.wait_for_vehicle(20.0)
        assert link.target == 3
        assert second.hears_something()


def test_the_vehicle_s_heartbeat_is_known_once_the_vehicle_is(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Whoever takes a mode that is not known for another one takes the vehicle from its pilot."""
    with GroundLink("udpin://127.0.0.1:0", system_id=7) as link, Autopilot(7, link.port) as vehicle:
        monkeypatch.setattr(link, "_send_heartbeat", lambda: time.sleep(0.1))
        vehicle.beat()
        link.wait_for_vehicle(20.0)
        assert link.latest("HEARTBEAT") is not None


def test_a_vehicle_with_another_system_id_is_named_in_the_error() -> None:
    with GroundLink("udpin://127.0.0.1:0", system_id=3) as link, Autopilot(7, link.port) as other:
        other.beat()
        with pytest.raises(LinkError, match=r"system 3 .* within 0\.5 s, only system 7"):
            link.wait_for_vehicle(0.5)


def test_a_vehicle_that_appears_later_does_not_disturb_the_one_that_is_flown(
    link: GroundLink, autopilot: Autopilot
) -> None:
    with Autopilot(3, link.port) as second:
        autopilot.beat()
        link.wait_for_vehicle(20.0)
        second.beat()
        time.sleep(0.1)
        link.wait_for_vehicle(20.0)
        assert link.target == 7


def test_a_link_whose_network_sends_nothing_goes_on() -> None:
    with GroundLink("udpout://255.255.255.255:18570") as link:  # broadcasts are not permitted
        link.send(text("lost"))
        with Autopilot(7, link.port) as vehicle:
            vehicle.beat()
            link.wait_for_vehicle(20.0)


@pytest.mark.parametrize(
    ("sent", "shown"),
    [
        ("Takeoff detected\t", "Takeoff detected"),
        ("\x1b[31mred\x07 alert\x00rubbish", "[31mred alert"),
    ],
)
def test_texts_are_shown_without_control_characters(
    link: GroundLink, autopilot: Autopilot, sent: str, shown: str
) -> None:
    autopilot.beat()
    autopilot.send(text(sent))
    assert until(lambda: bool(link.texts), 2.0)
    assert link.texts[-1][1] == shown


def test_a_text_in_chunks_is_shown_as_one(link: GroundLink, autopilot: Autopilot) -> None:
    long = "Preflight Fail: Compass sensor 0 missing, and another one too\t"
    autopilot.beat()
    autopilot.send(text(long[:50], number=9, chunk=0))
    autopilot.send(text(long[50:], number=9, chunk=1))
    assert until(lambda: bool(link.texts) and link.texts[-1][1].endswith("too"), 2.0)
    assert [words for _, words in link.texts] == [long.strip()]
