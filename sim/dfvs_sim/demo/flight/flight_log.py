"""What is known after a flight."""

from dataclasses import dataclass
from pathlib import Path

from dfvs_sim.demo.flight.telemetry import TelemetryWatch
from dfvs_sim.demo.flight.track import Track, TrackPoint
from dfvs_sim.demo.options import FlightOptions
from dfvs_sim.demo.plan import FlightPlan

SETTLE_S = 1.0
"""Time from the end of a flight until the pilot takes over."""


@dataclass(frozen=True, slots=True)
class FlightLog:
    """What is known after a flight."""

    plan: FlightPlan
    options: FlightOptions
    track: Track
    watch: TelemetryWatch
    engaged_ns: int
    ended_ns: int
    """When it reached its end or the timeout (monotonic)."""
    end_state: str
    end_cause: str
    """Of the gate at ``ended_ns``: what follows belongs to no flight any more."""
    vehicle_record: Path | None

    @property
    def flown(self) -> list[TrackPoint]:
        """Path from the engagement to the end."""
        return self.track.between(self.engaged_ns, self.ended_ns)

    @property
    def judged(self) -> list[TrackPoint]:
        """Path from the engagement to a second after the end, when the pilot takes over."""
        return self.track.between(self.engaged_ns, self.ended_ns + round(SETTLE_S * 1e9))
