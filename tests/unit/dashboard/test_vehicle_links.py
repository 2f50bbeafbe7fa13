from dfvs_service.dashboard.vehicles.vehicle_links import VehicleLinks
from dfvs_service.settings.sections import ZenohSection

FIRST, SECOND = (ZenohSection("client", (f"tcp/127.0.0.1:{port}",), ()) for port in (1, 2))
S = 1_000_000_000


def test_a_name_that_two_links_carry_stays_with_the_first_though_it_falls_silent():
    links = VehicleLinks()
    assert links.admit("swift", FIRST, 0)
    assert not links.admit("swift", SECOND, 1 * S)
    assert links.admit("swift", FIRST, 2 * S)
    assert not links.admit("swift", SECOND, 9 * S)
    assert links.get("swift") is FIRST
    (warning,) = links.warnings().values()
    assert "tcp/127.0.0.1:1 and by tcp/127.0.0.1:2" in warning
    assert "vehicle.name" in warning


def test_a_vehicle_that_moves_to_another_link_is_followed():
    links = VehicleLinks()
    links.admit("swift", FIRST, 0)
    assert links.admit("swift", SECOND, 3 * S)
    assert links.get("swift") is SECOND
    assert links.warnings() == {}


def test_vehicles_of_different_names_are_heard_at_the_same_time():
    links = VehicleLinks()
    assert links.admit("swift", FIRST, 0)
    assert links.admit("heron", SECOND, 0)
    assert links.warnings() == {}
