"""A ground-station link on a port of its own, and an autopilot that sends to it."""

from collections.abc import Iterator

import pytest
from autopilot_socket import Autopilot

from dfvs_sim.ground.link import GroundLink


@pytest.fixture
def link() -> Iterator[GroundLink]:
    with GroundLink("udpin://127.0.0.1:0") as link:
        yield link


@pytest.fixture
def autopilot(link: GroundLink) -> Iterator[Autopilot]:
    """The autopilot of system 7."""
    with Autopilot(7, link.port) as autopilot:
        yield autopilot
