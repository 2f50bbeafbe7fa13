"""Settings sections of telemetry, recordings and the black box."""

from dataclasses import dataclass

from dfvs_core.errors import ConfigError
from dfvs_core.messages.schema import setting


@dataclass(frozen=True, slots=True)
class TelemetrySection:
    """What the service publishes."""

    state_hz: float = setting(
        10.0, "rate of the state; every command waits for one", low=1.0, high=50.0
    )
    preview_hz: float = setting(5.0, "rate of the preview image; 0: none", low=0.0, high=30.0)
    preview_quality: int = setting(70, "JPEG quality of the preview", low=1, high=100)
    flow_hz: float = setting(
        10.0, "rate of the flow for the dashboard; 0: none", low=0.0, high=30.0
    )


@dataclass(frozen=True, slots=True)
class RecordSection:
    """Recordings of flights; see docs/how-to/recording.md."""

    folder: str = setting("", "where recordings go; empty: none are made")
    max_file_mb: float = setting(
        1000.0,
        "size at which the next file of a recording begins, MB; half of max_total_mb at most",
        low=1.0,
        high=100_000.0,
    )
    max_total_mb: float = setting(
        20_000.0,
        "size of a recording beyond which its oldest file goes",
        low=2.0,
        high=10_000_000.0,
    )
    min_free_mb: float = setting(
        500.0, "free space that is left on the disk: no more is written", low=0.0, high=1_000_000.0
    )


@dataclass(frozen=True, slots=True)
class BlackBoxSection:
    """Records of every flight; see docs/how-to/recording.md."""

    enabled: bool = setting(True, "false: flights leave no records")
    folder: str = setting(
        "", "where flights go; empty: $STATE_DIRECTORY/flights, or ~/.local/state/dfvs/flights"
    )
    max_flight_mb: float = setting(
        500.0, "largest size of one flight, MB", low=10.0, high=100_000.0
    )
    max_total_mb: float = setting(
        5000.0, "size of all flights beyond which the oldest go", low=10.0, high=10_000_000.0
    )
    min_free_mb: float = setting(
        200.0, "free space that is left on the disk: no more is written", low=0.0, high=1_000_000.0
    )

    def __post_init__(self) -> None:
        """Refuse a flight that could be larger than all of them."""
        if self.max_flight_mb > self.max_total_mb:
            raise ConfigError(
                f"black_box.max_flight_mb = {self.max_flight_mb:g} is more than "
                f"black_box.max_total_mb = {self.max_total_mb:g}",
                "one flight to be no larger than all flights",
            )
