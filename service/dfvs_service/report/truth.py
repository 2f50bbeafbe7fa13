"""True errors of a simulated flight."""

import json
import math
from pathlib import Path

from dfvs_core.errors import ConfigError
from dfvs_core.gate.config import S
from dfvs_service.report.flight import Flight


def add_truth(flight: Flight, path: Path) -> None:
    """Put the true distance and angle to the goal beside the estimated ones.

    ``path`` holds JSON lines with ``t_ns`` (monotonic), ``error_m`` and ``error_rad``.

    Raises ConfigError if the file cannot be read or holds something else.
    """
    try:
        for line in path.read_text(encoding="utf-8").splitlines():
            record = json.loads(line)
            t_s = (int(record["t_ns"]) - flight.start_ns) / S
            flight.series.true_m.append((t_s, float(record["error_m"])))
            flight.series.true_deg.append((t_s, math.degrees(float(record["error_rad"]))))
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise ConfigError(
            f"the true errors cannot be read from {path} ({error!r})",
            "JSON lines with t_ns, error_m and error_rad",
        ) from error
