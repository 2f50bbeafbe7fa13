"""Table of the Zenoh keys."""

import re
from dataclasses import dataclass

from dfvs_core.errors import ConfigError

_NAME = re.compile(r"[a-z0-9][a-z0-9_-]{0,62}")


@dataclass(frozen=True, slots=True)
class Topics:
    """Zenoh keys of one vehicle.

    ========== ============= ======= ==========================================================
    key        publisher     rate    content
    ========== ============= ======= ==========================================================
    camera     camera        frame   JPEG, PNG or raw pixels; attachment: ``messages.frame``
    state      service       10 Hz   JSON: gate state, cause, vehicle mode and battery
    answer     service       command JSON: request id of a command, and the gate's answer to it
    servo      service       frame   JSON: error, velocity, inliers, conditioning, depth
    timing     service       1 Hz    JSON: latency of each stage, p50 and p99, in ms
    preview    service       5 Hz    JPEG: current view with the flow drawn on it [1]_
    flow       service       10 Hz   grid of flow, confidence: ``perception.flow_grid`` [1]_
    goal       service       change  JPEG: goal image (cached); attachment: ``messages.frame``
    route      service       change  JSON: number of the goal at hand, of how many (cached)
    config     service       once    JSON: resolved configuration (cached for late joiners)
    opening    service       change  ``messages.frame_record``: session header (cached)
    turn       service       frame   ``messages.frame_record``: for recorders [1]_
    command    operator      --      JSON: signed engage, hold, abort
    new_goal   operator      --      ``messages.goal_command``; attachment: signed command
    lease      service       --      liveliness tokens: who stands by, who is engaged
    ========== ============= ======= ==========================================================

    .. [1] Made only while somebody subscribes.
    """

    vehicle: str = "drone1"

    def __post_init__(self) -> None:
        """Refuse names that would change the meaning of a key."""
        if not _NAME.fullmatch(self.vehicle):
            raise ConfigError(f"vehicle name {self.vehicle!r}", "1 to 63 of a-z, 0-9, '-' and '_'")

    @property
    def camera(self) -> str:
        """Key of the camera frames."""
        return f"dfvs/{self.vehicle}/camera"

    @property
    def calibration(self) -> str:
        """Key of the camera's intrinsics, as JSON, kept for subscribers that join later."""
        return f"{self.camera}/calibration"

    @property
    def command(self) -> str:
        """Key of signed operator commands."""
        return f"dfvs/{self.vehicle}/command"

    @property
    def new_goal(self) -> str:
        """Key of new goals, each with the signed command for it."""
        return f"dfvs/{self.vehicle}/new_goal"

    def lease(self, part: str, service: str) -> str:
        """Key of a service's liveliness token; ``part`` is standby or engaged, ``*`` is any."""
        return f"dfvs/{self.vehicle}/lease/{part}/{service}"

    def telemetry(self, name: str) -> str:
        """Key of one of the service's streams, such as ``state``: see the table."""
        return f"dfvs/{self.vehicle}/{name}"
