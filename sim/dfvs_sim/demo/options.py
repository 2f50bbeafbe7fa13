"""Options of one demo flight."""

from collections.abc import Callable
from dataclasses import dataclass, field

from dfvs_sim.demo.conditions import Conditions

VEHICLE_NAME = "demo"
FIRST_SYSTEM_ID = 1
"""Of the simulated vehicle, as of a PX4 SITL."""


@dataclass(frozen=True, slots=True)
class FlightOptions:
    """How to fly."""

    timeout_s: float = 90.0
    ready_s: float = 40.0
    """How long the service may take to be ready; ``timeout_s`` is of the flight."""
    rate_hz: float = 15.0
    """Frames a second."""
    camera_nice: int = 0
    """How far the simulated camera gives way to the service."""
    vehicle: str = VEHICLE_NAME
    """Name of the vehicle in the Zenoh keys."""
    system_id: int | None = None
    """MAVLink system id; None takes 1 for the simulated vehicle, and the id on the companion's link
    for another one.
    """
    autopilot: str | None = None
    """MAVLink URL of a vehicle that runs already; None starts the simulated one."""
    ground: str | None = None
    """URL of that vehicle's ground-station link."""
    conditions: Conditions = field(default_factory=Conditions)
    service: tuple[str, ...] = ()
    """Further words for ``dfvs-service``."""
    camera: str = "dfvs"
    """How frames travel (see ``CAMERAS``)."""
    dashboard: bool = False
    """Serve a page to watch the flight in a browser."""
    pause: Callable[[str], None] = lambda _: None
    """Called before and after a flight with what the user may do."""

    @property
    def is_simulated(self) -> bool:
        """Whether the flight brings its own simulated vehicle."""
        return self.autopilot is None

    @property
    def estimate(self) -> str | None:
        """Grade of the state estimate; None beside another autopilot, where it is unknown."""
        return self.conditions.estimate if self.is_simulated else None

    @property
    def wind(self) -> str | None:
        """Wind, likewise."""
        return self.conditions.wind if self.is_simulated else None
