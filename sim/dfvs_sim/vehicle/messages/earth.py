"""Where the local frame lies on the earth, and the messages that say so."""

import math

from pymavlink.dialects.v20 import development as mavlink

from dfvs_sim.dynamics.rigid_body import Quadrotor, Vector
from dfvs_sim.geodesy import metres_per_degree

HOME_LATITUDE_DEG, HOME_LONGITUDE_DEG, HOME_ALTITUDE_M = 47.397742, 8.545594, 488.0
"""Where the local frame's origin lies on the earth; the altitude is above mean sea level."""

_EARTH_RADIUS_M = 6371000.0


def attitude_quaternion(roll: float, pitch: float, yaw: float) -> tuple[float, ...]:
    """Quaternion (w, x, y, z) of aerospace angles in rad."""
    cr, sr = math.cos(roll / 2), math.sin(roll / 2)
    cp, sp = math.cos(pitch / 2), math.sin(pitch / 2)
    cy, sy = math.cos(yaw / 2), math.sin(yaw / 2)
    return (
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )


def global_position(position_m: Vector) -> tuple[int, int, int]:
    """Latitude and longitude in 1e-7 degree and altitude in mm of a local position (NED, m).

    The autopilot's map projection is that of a sphere.
    """
    north_m, east_m, down_m = position_m
    latitude = HOME_LATITUDE_DEG + math.degrees(north_m / _EARTH_RADIUS_M)
    radius = _EARTH_RADIUS_M * math.cos(math.radians(HOME_LATITUDE_DEG))
    longitude = HOME_LONGITUDE_DEG + math.degrees(east_m / radius)
    return round(latitude * 1e7), round(longitude * 1e7), round((HOME_ALTITUDE_M - down_m) * 1000)


def global_origin(time_us: int) -> mavlink.MAVLink_gps_global_origin_message:
    """GPS_GLOBAL_ORIGIN."""
    return mavlink.MAVLink_gps_global_origin_message(*global_position((0.0, 0.0, 0.0)), time_us)


def true_state(vehicle: Quadrotor) -> mavlink.MAVLink_hil_state_quaternion_message:
    """HIL_STATE_QUATERNION, the true motion, as PX4's simulation sends it.

    Numbers are cut off towards zero; the time is 0 and accelerations are in m/s² (PX4 v1.17).
    """
    v = vehicle
    along, across = metres_per_degree(HOME_LATITUDE_DEG, HOME_ALTITUDE_M)
    return mavlink.MAVLink_hil_state_quaternion_message(
        0,
        attitude_quaternion(*v.attitude_rad),
        *v.rates_rad_s,
        int((HOME_LATITUDE_DEG + v.north_m / along) * 1e7),
        int((HOME_LONGITUDE_DEG + v.east_m / across) * 1e7),
        int((HOME_ALTITUDE_M - v.down_m) * 1e3),
        *(int(100.0 * speed) for speed in v.velocity_m_s),
        0,
        0,
        *(int(a) for a in v.acceleration_m_s2),
    )
