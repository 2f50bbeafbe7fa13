import dataclasses
import json
import math

import pytest

from dfvs_core.errors import DfvsError
from dfvs_core.messages.frame import NO_CLOCK
from dfvs_core.messages.link import GateStatus, VehicleState
from dfvs_core.messages.schema import dump
from dfvs_service.dashboard.outbox import ImageKind
from dfvs_service.dashboard.vehicles.clock import Moment
from dfvs_service.dashboard.vehicles.sample import BrowserImage
from dfvs_service.dashboard.vehicles.vehicle_model import PATH_COLUMNS, SERVO_COLUMNS, VehicleModel

OURS = b"o" * 16
MS = 1_000_000
NOW = Moment(10_000 * MS, 1_000_000.0)
VEHICLE = VehicleState(9_990 * MS, 0.0, 0.0, 0.5, (0.3, 0.4, 0.0), (1.0, 2.0, -1.5))


def status(state="SERVO", **fields):
    given = {"t_ns": 9_990 * MS, "since_ns": 7_990 * MS, "challenge": "secret", **fields}
    return dump(GateStatus(state, "good data", VEHICLE, **given))


def servo(**fields):
    document = {
        "t_ns": 9_980 * MS,
        "t_capture_ns": 9_940 * MS,
        "status": "OK",
        "reason": "",
        "error_m": 0.25,
        "error_rad": 0.1,
        "median_error_px": 3.0,
        "residual_px": None,
        "inlier_share": 0.9,
        "overlap": 0.8,
        "condition": 120.0,
        "depth_m": 2.5,
        "motion": [0.1, 0.2, 0.3, 0.4],
    }
    return document | fields


def test_the_state_tells_since_when_it_is_and_keeps_the_challenge_back():
    news = VehicleModel("a").on_document("state", status(), NOW)
    assert news["state"]["t_ms"] == 1_000_000.0 - 10
    assert news["state"]["since_ms"] == 1_000_000.0 - 2_010
    assert news["state"]["accepts_commands"] is True
    assert "secret" not in json.dumps(news)


def test_only_a_change_of_state_is_an_event():
    model = VehicleModel("a")
    assert "transitions" in model.on_document("state", status("READY"), NOW)
    assert "transitions" not in model.on_document("state", status("READY"), NOW)
    (event,) = model.on_document("state", status("ABORT"), NOW)["transitions"]
    assert (event["to"], event["cause"]) == ("ABORT", "good data")
    assert [e["to"] for e in model.history(NOW)["history"]["transitions"]] == ["READY", "ABORT"]


def path_row(model, vehicle, **fields):
    document = status(**fields) | {"vehicle": dump(vehicle)}
    (row,) = model.on_document("state", document, NOW)["path"]
    return dict(zip(PATH_COLUMNS, row, strict=True))


def test_a_path_row_holds_position_attitude_and_the_commanded_and_flown_velocity():
    model = VehicleModel("a")
    named = path_row(model, VEHICLE, t_ns=9_995 * MS, setpoint=(0.1, 0.0, 0.0, 0.2))
    assert named["t_ms"] == 1_000_000.0 - 10  # of the vehicle's own stamp
    assert (named["north_m"], named["east_m"], named["down_m"]) == (1.0, 2.0, -1.5)
    assert (named["roll_rad"], named["pitch_rad"], named["yaw_rad"]) == (0.0, 0.0, 0.5)
    assert named["setpoint"] == [0.1, 0.0, 0.0, 0.2]
    cos, sin = math.cos(0.5), math.sin(0.5)
    flown = [0.3 * cos + 0.4 * sin, 0.4 * cos - 0.3 * sin, 0.0]
    assert named["flown"] == [*map(pytest.approx, flown), None]


@pytest.mark.parametrize(
    ("yaw", "after_ms", "rate"), [(-3.13, 100, 0.2319), (3.0, 100, -1.3), (3.1, 1500, None)]
)
def test_the_flown_yaw_rate_is_between_two_states_that_follow_closely(yaw, after_ms, rate):
    model = VehicleModel("a")
    path_row(model, dataclasses.replace(VEHICLE, yaw_rad=3.13))
    later = dataclasses.replace(VEHICLE, yaw_rad=yaw, t_ns=VEHICLE.t_ns + after_ms * MS)
    flown = path_row(model, later, t_ns=later.t_ns)["flown"]
    assert flown[3] == (rate if rate is None else pytest.approx(rate, abs=1e-3))


def test_a_velocity_beyond_all_floats_is_unknown_and_spoils_no_history():
    model = VehicleModel("a")
    fast = dataclasses.replace(VEHICLE, velocity_m_s=(1.7e308, 1.7e308, 0.0), yaw_rad=0.8)
    assert path_row(model, fast)["flown"][0] is None
    json.dumps(model.history(NOW), allow_nan=False)


def test_a_vehicle_that_is_not_heard_any_more_adds_nothing_to_the_path():
    model = VehicleModel("a")
    model.on_document("state", status(), NOW)
    assert "path" not in model.on_document("state", status(t_ns=9_999 * MS), NOW)


def test_fields_of_a_newer_service_are_passed_over():
    assert "state" in VehicleModel("a").on_document("state", status() | {"of_tomorrow": 1}, NOW)


def test_a_servo_row_is_stamped_with_its_capture_and_knows_its_delay():
    (row,) = VehicleModel("a").on_document("servo", servo(), NOW)["servo"]
    named = dict(zip(SERVO_COLUMNS, row, strict=True))
    assert named["t_ms"] == 1_000_000.0 - 60
    assert named["delay_ms"] == pytest.approx(40)
    assert named["error_m"] == 0.25
    assert named["residual_px"] is None


def test_a_servo_row_holds_the_uncertainty_where_it_is_known():
    known = {
        "error_spread_m": 0.02,
        "scale_spread": 0.1,
        "odometry_error_m_s": 0.03,
        "mean_error_m": 0.5,
        "mean_error_spread_m": 0.04,
        "mounting_score": -7.5,
        "velocity_error": [0.1, 0.2, 0.3, 0.0],
    }
    model = VehicleModel("a")
    (row,) = model.on_document("servo", servo(**known), NOW)["servo"]
    assert known.items() <= dict(zip(SERVO_COLUMNS, row, strict=True)).items()
    (row,) = model.on_document("servo", servo(**dict.fromkeys(known)), NOW)["servo"]
    unknown = dict.fromkeys(known) | {"velocity_error": []}
    assert unknown.items() <= dict(zip(SERVO_COLUMNS, row, strict=True)).items()


@pytest.mark.parametrize("value", [float("nan"), float("inf"), 10**400, "x", [1], True, None])
def test_what_is_no_finite_number_reaches_nobody(value):
    model = VehicleModel("a")
    news = model.on_document(
        "servo", servo(depth_m=value, motion=[value], velocity_error=value), NOW
    )
    assert dict(zip(SERVO_COLUMNS, news["servo"][0], strict=True))["depth_m"] is None
    timing = {"stages": {"match": {"p50_ms": value, "p99_ms": 1.0}}, "frames": value}
    assert model.on_document("timing", timing, NOW)["timing"]["stages"]["match"] == [None, 1.0]
    json.dumps(model.history(NOW), allow_nan=False)


@pytest.mark.parametrize(
    ("stream", "document"),
    [
        ("state", {"state": "SERVO"}),
        ("state", []),
        ("state", status() | {"battery": float("nan")}),
        ("state", status() | {"battery": 10**400}),
        ("state", status() | {"t_ns": 10**400}),
        ("state", status() | {"vehicle": dump(VEHICLE) | {"t_ns": -(10**400)}}),
        ("servo", 3),
        ("servo", {}),
        ("servo", servo(t_ns="now")),
        ("servo", servo(t_capture_ns=True)),
        ("servo", servo(t_ns=1 << 80)),
        ("timing", None),
        ("config", "x"),
    ],
)
def test_documents_that_follow_no_schema_are_refused(stream, document):
    model = VehicleModel("a")
    with pytest.raises(DfvsError):
        model.on_document(stream, document, NOW)
    assert model.history(NOW)["history"] == {"servo": [], "path": [], "transitions": []}


def test_history_is_bounded():
    model = VehicleModel("a")
    for i in range(4000):
        t_ns = NOW.t_ns + i * 100 * MS
        model.on_document("servo", servo(t_capture_ns=t_ns), Moment(t_ns, NOW.wall_ms + i * 100))
    assert len(model.history(NOW)["history"]["servo"]) == 3000


def test_what_was_kept_has_its_times_by_a_clock_that_was_set():
    model = VehicleModel("a")
    model.on_document("state", status(), NOW)
    model.on_document("servo", servo(), NOW)
    later = Moment(NOW.t_ns + 500 * MS, NOW.wall_ms - 60_000)  # set back by a minute
    known = model.history(later)
    ages = [later.wall_ms - known["history"][table][0][0] for table in ("path", "servo")]
    ages += [later.wall_ms - known["state"]["t_ms"], later.wall_ms - model.listing(later)["t_ms"]]
    ages.append(later.wall_ms - known["history"]["transitions"][0]["t_ms"])
    assert ages == pytest.approx([510, 560, 510, 510, 2510])


def test_the_history_of_results_is_thinned_to_ten_a_second():
    model = VehicleModel("a")
    for i in range(100):
        model.on_document("servo", servo(t_capture_ns=NOW.t_ns - (3960 - 40 * i) * MS), NOW)
    assert len(model.history(NOW)["history"]["servo"]) == 34


def kept_goal(sent_ns, clock=NO_CLOCK):
    return BrowserImage(ImageKind.GOAL, sent_ns, 0, b"jpeg", clock)


@pytest.mark.parametrize("clock", [NO_CLOCK, OURS])
def test_a_goal_that_was_kept_for_long_leaves_the_age_of_states_exact(clock):
    model = VehicleModel("a", OURS)
    model.on_image("goal", kept_goal(NOW.t_ns - 60_000 * MS, clock), NOW)
    later = Moment(NOW.t_ns + 12_000 * MS, NOW.wall_ms + 12_000)
    for now, age_ms in ((NOW, 10), (later, 12_010)):
        state = model.on_document("state", status(), now)["state"]
        assert now.wall_ms - state["t_ms"] == pytest.approx(age_ms)
    assert model.link_update(later)["link"]["is_foreign_clock"] is False


def test_the_goal_s_clock_is_the_service_s_whatever_the_camera_says():
    model = VehicleModel("a", OURS)
    camera = BrowserImage(ImageKind.VIEW, NOW.t_ns, 1, b"jpeg", b"t" * 16)
    for stream, image, is_foreign in (
        ("camera", camera, True),
        ("goal", kept_goal(NOW.t_ns, OURS), False),
        ("camera", camera, False),
    ):
        model.on_image(stream, image, NOW)
        assert model.link_update(NOW)["link"]["is_foreign_clock"] is is_foreign


def test_links_tell_rate_age_and_loss_of_the_camera():
    model = VehicleModel("a")
    for seq in (1, 2, 4):
        model.on_image("camera", BrowserImage(ImageKind.VIEW, NOW.t_ns, seq, b"jpeg"), NOW)
    later = Moment(NOW.t_ns + 500 * MS, NOW.wall_ms + 500)
    camera = model.link_update(later)["link"]["streams"]["camera"]
    assert (camera["count"], camera["missing"], camera["age_s"]) == (3, 1, 0.5)
