"""Between ground and air: spool-up, the ramp of take-off, and noticing that one has landed."""

import enum
import math

from dfvs_sim.vehicle.parameters import ParameterTable


class Rotors(enum.Enum):
    """What the rotors do."""

    STILL = "still"
    SPOOLING = "spooling"
    IDLE = "idle"
    RAMP = "ramp"
    FLIGHT = "flight"


class Liftoff:
    """State of the rotors from arming to flight and back."""

    def __init__(self, parameters: ParameterTable) -> None:
        self._parameters = parameters
        self._since_s = 0.0
        self.rotors = Rotors.STILL

    @property
    def flying(self) -> bool:
        """Whether the position loop commands the rotors."""
        return self.rotors in (Rotors.RAMP, Rotors.FLIGHT)

    @property
    def climb_limit_m_s(self) -> float:
        """Climb speed allowed now: it grows during the ramp."""
        if self.rotors is Rotors.FLIGHT:
            return math.inf
        ramp_s = self._parameters["MPC_TKO_RAMP_T"]
        share = min(1.0, self._since_s / ramp_s) if ramp_s > 0.0 else 1.0
        return float(share * self._parameters["MPC_TKO_SPEED"])

    def update(self, dt_s: float, *, armed: bool, landed: bool, wants_up: bool) -> None:
        """Advance by dt_s."""
        self._since_s += dt_s
        self._go(self._next(landed=landed, wants_up=wants_up) if armed else Rotors.STILL)

    def _next(self, *, landed: bool, wants_up: bool) -> Rotors:
        """State that follows the present one while armed."""
        p, state = self._parameters, self.rotors
        if state is Rotors.STILL:
            return Rotors.SPOOLING
        if state is Rotors.SPOOLING:
            return Rotors.IDLE if self._since_s >= p["COM_SPOOLUP_TIME"] else state
        if state is Rotors.IDLE:
            return Rotors.RAMP if wants_up else state
        if landed and (state is Rotors.FLIGHT or not wants_up):
            return Rotors.IDLE
        if state is Rotors.RAMP and self._since_s >= p["MPC_TKO_RAMP_T"]:
            return Rotors.FLIGHT
        return state

    def _go(self, state: Rotors) -> None:
        if state is not self.rotors:
            self.rotors = state
            self._since_s = 0.0


class LandDetector:
    """Landed once the ground has been touched for a while without a wish to rise."""

    TOUCH_S = 2.0

    def __init__(self) -> None:
        self._touching_s = 0.0
        self.landed = True

    def update(self, dt_s: float, *, on_ground: bool, sinking: bool, flying: bool) -> bool:
        """Whether the vehicle is landed; ``sinking`` says that the demand points down."""
        if not on_ground:
            self.landed = False
        if on_ground and (sinking or not flying):
            self._touching_s += dt_s
            self.landed = self.landed or self._touching_s >= self.TOUCH_S
        else:
            self._touching_s = 0.0
        return self.landed
