"""Leases of two services for the same vehicle, over real Zenoh."""

import pytest
from loopback import free_endpoint
from waiting import until

from dfvs_core.messages.link import LeaseHolders
from dfvs_core.messages.topics import Topics
from dfvs_service.operator_link.name_lease import NameLease
from dfvs_service.settings.config import load_config
from dfvs_service.zenoh_session import open_session

TOPICS = Topics("swift")
WITHIN_S = 5.0


@pytest.fixture
def sessions():
    """Two peers that are connected."""
    endpoint = free_endpoint()
    listening = load_config(None, {"zenoh.listen": [endpoint]}).zenoh
    calling = load_config(None, {"zenoh.listen": [], "zenoh.connect": [endpoint]}).zenoh
    with open_session(listening) as a, open_session(calling) as b:
        yield a, b


def wait_for(lease, standing_by, engaged):
    wanted = LeaseHolders(standing_by, engaged)
    assert until(lambda: lease.holders() == wanted, WITHIN_S), lease.holders()


def test_two_services_see_each_other_come_engage_and_go(sessions):
    told = []
    first = NameLease(sessions[0], TOPICS, told.append)
    first.notify()
    second = NameLease(sessions[1], TOPICS, told.append)
    wait_for(first, (second.name,), ())
    wait_for(second, (first.name,), ())
    first.show("SERVO")
    wait_for(second, (first.name,), (first.name,))
    first.show("HOLD")
    first.show("ABORT")
    wait_for(second, (first.name,), ())
    second.close()
    wait_for(first, (), ())


def test_a_service_that_ends_without_a_word_holds_no_lease(sessions):
    first = NameLease(sessions[0], TOPICS, lambda _: None)
    second = NameLease(sessions[1], TOPICS, lambda _: None)
    wait_for(first, (second.name,), ())
    sessions[1].close()
    wait_for(first, (), ())


def test_services_of_other_vehicles_do_not_matter(sessions):
    first = NameLease(sessions[0], TOPICS, lambda _: None)
    other = NameLease(sessions[1], Topics("stork"), lambda _: None)
    third = NameLease(sessions[1], TOPICS, lambda _: None)
    wait_for(first, (third.name,), ())
    assert other.holders() == LeaseHolders()


def test_the_gate_is_told_of_a_change_at_once_and_again_every_second(sessions):
    told = []
    first = NameLease(sessions[0], TOPICS, told.append)
    first.notify()
    first.notify()
    assert told == [LeaseHolders()]
    second = NameLease(sessions[1], TOPICS, lambda _: None)
    wait_for(first, (second.name,), ())
    first.notify()
    first.notify()
    assert told[1:] == [LeaseHolders((second.name,))]
    second.close()
    wait_for(first, (), ())
    first.notify()
    assert told[2:] == [LeaseHolders()]
    assert until(lambda: first.notify() or told[3:], WITHIN_S) == [LeaseHolders()]
