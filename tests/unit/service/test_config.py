import math
import re
from pathlib import Path

import pytest

from dfvs_core.errors import ConfigError, DfvsError
from dfvs_core.gate.config import Engage, GateConfig, OnDone, S
from dfvs_core.geometry.camera import CameraModel
from dfvs_core.messages.goal import GoalSidecar, Mount
from dfvs_service.settings.config import (
    ServiceConfig,
    config_from_json,
    load_config,
    parse_assignment,
)
from dfvs_service.settings.config_text import markdown_table, toml_text

CAMERA = CameraModel.from_horizontal_fov(320, 240, 1.2)
SIDECAR = GoalSidecar(CAMERA, mount=Mount(pitch_rad=0.3))


def write(folder, text):
    path = folder / "service.toml"
    path.write_text(text)
    return path


def test_angles_are_degrees_in_the_file_and_radians_inside(tmp_path):
    text = "[limits]\nyaw_deg_s = 10\n[camera.mount]\npitch_deg = -20\n[servo]\ntolerance_deg = 1\n"
    config = load_config(write(tmp_path, text), {})
    assert config.limits.yaw_rad_s == pytest.approx(math.radians(10))
    assert config.camera.mount == Mount(pitch_rad=math.radians(-20))
    assert config.servo.tolerance_rad == pytest.approx(math.radians(1))


def test_the_command_line_wins_over_the_file(tmp_path):
    path = write(tmp_path, '[gate]\nengage = "command"\non_done = "hold"\n')
    config = load_config(path, {"gate.engage": "auto"})
    assert (config.gate.engage, config.gate.on_done) == (Engage.AUTO, OnDone.HOLD)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[gatte]\n", ["unknown key 'gatte'", "did you mean 'gate'"]),
        ("[gate]\nengaged = 1\n", ["'gate.engaged'", "did you mean 'engage'"]),
        ("[limits]\nyaw_rad_s = 1\n", ["did you mean 'yaw_deg_s'"]),
        ("[gate]\nproof_s = 1\n", ["'gate.proof_s'", "'response_s'"]),
        ("[gate]\nproof_m_s = 0.1\n", ["'gate.proof_m_s'", "did you mean 'reduced_speed_m_s'"]),
        ("[limits]\nyaw_deg_s = 500\n", ["limits.yaw_deg_s = 500", "1 to 120"]),
        ("[telemetry]\nstate_hz = 0.5\n", ["telemetry.state_hz = 0.5", "1 to 50"]),
        ("[limits]\nhorizontal_m_s = nan\n", ["a finite number"]),
        ("[limits]\nhorizontal_m_s = '1'\n", ["limits.horizontal_m_s", "expected a number"]),
        ("[gate]\nengage = 'aut'\n", ["did you mean 'auto'"]),
        ("[vehicle]\nname = 'My Drone'\n", ["'My Drone'"]),
        ("gate = 3\n", ["gate is 3", "a table"]),
        ("[gate\n", ["is not TOML"]),
        ("[gate]\nmin_frame_hz = 4\n", ["gate.min_frame_hz", "expected 5 to 60"]),
        ("[servo]\ndepth = 'given'\n", ["no camera sends"]),
        ("[zenoh]\nmode = 'client'\n", ["zenoh.connect"]),
        ("[zenoh]\nlisten = ['tls/10.0.0.1:7447']\n", ["dfvs-certs"]),
        ("[zenoh]\nconnect = ['tls/10.0.0.1:7447']\n", ["dfvs-certs"]),
        ("[flow]\nworking_width_px = -1\n", ["working_width_px = -1; expected 0, or 64 to"]),
        ("[flow]\nworking_width_px = 20\n", ["working_width_px = 20; expected 0, or 64 to"]),
        ("[flow]\nworking_width_px = 1921\n", ["working_width_px = 1921; expected 0, or 64 to"]),
        (
            "[black_box]\nmax_flight_mb = 20\nmax_total_mb = 10\n",
            ["max_flight_mb = 20 is more than black_box.max_total_mb = 10"],
        ),
    ],
)
def test_what_is_wrong_in_a_file_is_said_in_one_line(tmp_path, text, words):
    with pytest.raises(ConfigError) as error:
        load_config(write(tmp_path, text), {})
    for word in words:
        assert word in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("name", "problem"), [("none.toml", "cannot read"), (".", "cannot read"), ("x", "not TOML")]
)
def test_a_file_that_cannot_be_read_is_an_error(tmp_path, name, problem):
    (tmp_path / "x").write_bytes(b"\xff\xfe")
    with pytest.raises(ConfigError, match=problem):
        load_config(tmp_path / name, {})


@pytest.mark.parametrize(
    ("dotted", "value"), [("engage", "auto"), ("gate.engage.deep", 1), ("vehicle.name.x", 1)]
)
def test_an_override_must_name_a_setting(dotted, value):
    with pytest.raises(ConfigError):
        load_config(None, {"gate.engage": "auto", "vehicle.name": "a", dotted: value})


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("gate.engage=auto", ("gate.engage", "auto")),
        ("limits.slew_m_s2=0.3", ("limits.slew_m_s2", 0.3)),
        ("zenoh.listen=['tcp/[::1]:1']", ("zenoh.listen", ["tcp/[::1]:1"])),
        ("gate.exit_when_done = true", ("gate.exit_when_done", True)),
        ("vehicle.mavlink=udpin://0.0.0.0:1", ("vehicle.mavlink", "udpin://0.0.0.0:1")),
        ("vehicle.name=a=b", ("vehicle.name", "a=b")),
    ],
)
def test_assignments_are_toml_or_bare_text(text, expected):
    assert parse_assignment(text) == expected


@pytest.mark.parametrize("text", ["gate.engage", "=1", ""])
def test_an_assignment_needs_a_key_and_a_value(text):
    with pytest.raises(ConfigError, match=r"section\.key=value"):
        parse_assignment(text)


def test_the_printed_settings_read_back_the_same(tmp_path):
    config = load_config(
        None,
        {
            "camera.horizontal_fov_deg": 77.7,
            "camera.mount.pitch_deg": -12.3,
            "limits.yaw_deg_s": 11.1,
            "zenoh.listen": [],
            "vehicle.mavlink": 'serial:///dev/"odd":57600',
        },
    )
    again = load_config(write(tmp_path, toml_text(config)), {})
    # Degrees are printed with twelve digits, which radians keep but for the last places.
    assert toml_text(again) == toml_text(config)
    assert again.vehicle == config.vehicle
    assert again.limits.yaw_rad_s == pytest.approx(config.limits.yaw_rad_s, rel=1e-11)


def test_the_printed_defaults_name_and_explain_every_setting(tmp_path):
    text = toml_text(ServiceConfig())
    assert load_config(write(tmp_path, text), {}) == load_config(None, {})
    lines = ("yaw_deg_s = 20.0", "# [camera.mount]", 'engage = "pilot"', "# horizontal_fov_deg =")
    assert all(line in text for line in lines)


def test_the_deployed_example_is_the_printed_default():
    path = Path(__file__).parents[3] / "deploy" / "service.toml"
    renew = f"dfvs-service config > {path}"
    assert path.read_text() == toml_text(ServiceConfig()), f"renew it with: {renew}"


def test_the_table_has_a_row_with_a_meaning_for_every_setting():
    rows = [row.split(" | ") for row in markdown_table(ServiceConfig()).splitlines()[2:]]
    assert len(rows) == len(re.findall(r"^(?:# )?\w+ =", toml_text(ServiceConfig()), re.MULTILINE))
    assert all(meaning.removesuffix(" |") for *_, meaning in rows)
    assert ["| `limits.yaw_deg_s`", "`20.0`", "1 to 120"] in [row[:3] for row in rows]
    assert ["| `zenoh.mode`", '`"peer"`', "`peer`, `client`"] in [row[:3] for row in rows]


def test_children_read_what_the_parent_wrote():
    config = load_config(None, {"camera.mount.yaw_deg": 5, "gate.engage": "command"})
    assert config_from_json(config.to_json()) == config


# --- camera -----------------------------------------------------------------------------


def test_a_field_of_view_makes_a_pinhole_of_the_goals_size():
    config = load_config(None, {"camera.horizontal_fov_deg": 90})
    _, camera = config.with_camera((320, 240), None)
    assert camera.size == (320, 240)
    assert camera.fx == pytest.approx(160.0)


def test_without_intrinsics_the_goals_sidecar_gives_lens_and_mounting():
    config, camera = ServiceConfig().with_camera((320, 240), SIDECAR)
    assert camera == CAMERA
    assert config.camera.model() == CAMERA
    assert config.camera.mount == SIDECAR.mount


def test_settings_win_over_the_sidecar():
    config = load_config(None, {"camera.horizontal_fov_deg": 90, "camera.mount.x_m": 0.1})
    config, camera = config.with_camera((320, 240), SIDECAR)
    assert camera.fx == pytest.approx(160.0)
    assert config.camera.mount == Mount(x_m=0.1)


@pytest.mark.parametrize(
    ("settings", "is_named"),
    [
        ({"camera.source": "ros2-rmw"}, True),
        ({"camera.source": "ros2-rmw", "camera.ros2.compressed": True}, False),
        ({"camera.source": "ros2-bridge", "camera.width": 1920, "camera.height": 1200}, False),
        ({}, False),
    ],
)
def test_ros_2_images_above_the_limit_of_a_message_are_named_where_none_come(settings, is_named):
    size = {"camera.width": 2048, "camera.height": 1536}
    cause = load_config(None, {**size, **settings}).camera.silence_cause
    assert ("2048 x 1536 px are above 8 MiB" in cause) == is_named


def test_without_anything_known_of_the_lens_there_is_no_flight():
    with pytest.raises(ConfigError, match="--camera-fov"):
        ServiceConfig().with_camera((320, 240), None)


LENS = {"camera.fx": 200.0, "camera.fy": 200.0, "camera.cx": 160.0, "camera.cy": 120.0}


@pytest.mark.parametrize(
    "settings",
    [
        {"camera.fx": 100.0},
        {"camera.distortion": [0.1, 0.0, 0.0, 0.0]},
        {"camera.horizontal_fov_deg": 90, "camera.fx": 100.0},
        {"camera.horizontal_fov_deg": 90, "camera.distortion": [0.1, 0.0, 0.0, 0.0]},
        {"camera.fx": 9.0, "camera.fy": 9.0, "camera.cx": 999.0, "camera.cy": 9.0},
        {**LENS, "camera.distortion": [-1.5, 0.0, 0.0, 0.0]},
    ],
)
def test_half_given_or_impossible_intrinsics_are_refused(settings):
    config = load_config(None, {"camera.width": 320, "camera.height": 240, **settings})
    with pytest.raises(DfvsError):
        config.camera.model()


def test_intrinsics_without_a_size_are_refused():
    with pytest.raises(ConfigError, match="size"):
        load_config(None, {"camera.horizontal_fov_deg": 90}).camera.model()


# --- gate -------------------------------------------------------------------------------


def test_default_settings_are_the_gates_own_but_for_holding_the_goal_by_vision():
    expected = GateConfig(on_done=OnDone.HOLD_VISUAL)
    assert load_config(None, {}).gate_config() == expected


def test_gate_settings_reach_the_gate():
    config = load_config(
        None,
        {
            "gate.engage": "command",
            "gate.hold_s": 2,
            "gate.reached_s": 0.5,
            "gate.response_s": 0,
            "gate.hold_visual_s": 30,
            "gate.reduced_speed_m_s": 0.2,
            "gate.min_overlap": 0.3,
            "gate.min_battery": 0.4,
            "gate.min_frame_hz": 7.5,
            "gate.max_jump_m": 1.5,
            "limits.horizontal_m_s": 0.7,
            "limits.vertical_m_s": 0.2,
            "limits.slew_m_s2": 0.4,
            "limits.yaw_deg_s": 30,
            "limits.yaw_slew_deg_s2": 90,
            "limits.max_distance_m": 9,
            "limits.max_engaged_s": 60,
        },
    ).gate_config()
    assert config.engage is Engage.COMMAND
    timing = config.timing
    assert (timing.hold_ns, timing.reached_ns, timing.response_ns) == (2 * S, S // 2, 0)
    assert config.hold_visual_ns == 30 * S
    assert (config.reduced_speed_m_s, config.min_overlap, config.min_battery) == (0.2, 0.3, 0.4)
    assert (config.max_jump_m, config.max_distance_m, config.max_engaged_ns) == (1.5, 9.0, 60 * S)
    assert config.min_frame_hz == 7.5
    velocity = config.velocity
    assert (velocity.horizontal_m_s, velocity.vertical_m_s, velocity.slew_m_s2) == (0.7, 0.2, 0.4)
    assert velocity.yaw_rad_s == pytest.approx(math.radians(30))
    assert velocity.yaw_slew_rad_s2 == pytest.approx(math.radians(90))


def test_a_service_that_ends_with_the_flight_leaves_the_vehicle_in_hold():
    config = load_config(None, {"gate.exit_when_done": True, "gate.on_done": "zero"})
    assert config.gate_config().on_done is OnDone.HOLD


@pytest.mark.parametrize(("axis", "least_m_s2"), [("horizontal", 1.54), ("vertical", 1.0)])
def test_a_speed_that_is_braked_too_late_for_the_goal_is_refused(axis, least_m_s2):
    fast = {f"limits.{axis}_m_s": 2, f"servo.max_{axis}_m_s": 2}
    remedy = rf"at least {least_m_s2:g} m/s².*raise limits\.slew_m_s2"
    with pytest.raises(ConfigError, match=remedy):
        load_config(None, fast)
    with pytest.raises(ConfigError, match=remedy):
        load_config(None, {**fast, "limits.slew_m_s2": least_m_s2 - 0.02})
    load_config(None, {**fast, "limits.slew_m_s2": least_m_s2})
    load_config(None, {f"limits.{axis}_m_s": 2})  # the law asks for no more than its own limit


@pytest.mark.parametrize(("rate_hz", "silence_s"), [(60, 2 / 60), (12.5, 0.16), (8, 0.2), (5, 0.2)])
def test_a_camera_is_silent_after_two_periods_of_the_lowest_rate_or_a_fifth_of_a_second(
    rate_hz, silence_s
):
    """One frame may be missing; a result older than that is flown by nobody anyway."""
    config = load_config(None, {"gate.min_frame_hz": rate_hz})
    assert config.silence_s == pytest.approx(silence_s)
    assert config.gate_config().min_frame_hz == rate_hz
