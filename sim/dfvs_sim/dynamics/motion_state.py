"""Motion of a vehicle, true or estimated, in the local frame (NED)."""

from dataclasses import dataclass

Vector = tuple[float, float, float]


@dataclass(slots=True)
class MotionState:
    """Position, velocity, acceleration, aerospace angles and body rates, and contact to the ground.

    Plain floats: they are read and written 250 times a second.
    """

    north_m: float = 0.0
    east_m: float = 0.0
    down_m: float = 0.0
    v_north_m_s: float = 0.0
    v_east_m_s: float = 0.0
    v_down_m_s: float = 0.0
    a_north_m_s2: float = 0.0
    a_east_m_s2: float = 0.0
    a_down_m_s2: float = 0.0
    roll_rad: float = 0.0
    pitch_rad: float = 0.0
    yaw_rad: float = 0.0
    roll_rate_rad_s: float = 0.0
    pitch_rate_rad_s: float = 0.0
    yaw_rate_rad_s: float = 0.0
    on_ground: bool = True

    @property
    def position_m(self) -> Vector:
        """North, east, down."""
        return self.north_m, self.east_m, self.down_m

    @property
    def velocity_m_s(self) -> Vector:
        """Towards north, east, down."""
        return self.v_north_m_s, self.v_east_m_s, self.v_down_m_s

    @property
    def acceleration_m_s2(self) -> Vector:
        """Towards north, east, down."""
        return self.a_north_m_s2, self.a_east_m_s2, self.a_down_m_s2

    @property
    def attitude_rad(self) -> Vector:
        """Roll, pitch, yaw."""
        return self.roll_rad, self.pitch_rad, self.yaw_rad

    @property
    def rates_rad_s(self) -> Vector:
        """About the body's axes."""
        return self.roll_rate_rad_s, self.pitch_rate_rad_s, self.yaw_rate_rad_s
