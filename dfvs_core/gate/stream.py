"""Setpoint stream: rate limit and slew of the velocity."""

import math

from dfvs_core.gate.config import GateConfig, S
from dfvs_core.gate.limits import ZERO, BodyVelocity, saturate, slew


class SetpointStream:
    """Remembers the last setpoint and when it was sent.

    A velocity is saturated, and slew-limited from the last setpoint. Zero is sent as it is and at
    once: a brake that is slew-limited is none.
    """

    def __init__(self, config: GateConfig) -> None:
        self._config = config
        self.last = ZERO
        self.is_silent = True
        """Nothing may be sent."""
        self._sent_ns: int | None = None

    def silence(self) -> None:
        """End the stream; it begins again from zero."""
        self.is_silent = True
        self.last = ZERO
        self._sent_ns = None

    def zero(self, now_ns: int) -> BodyVelocity | None:
        """Zero, if a setpoint is due or the last one was not zero."""
        if self.is_silent or (self.last == ZERO and self._gap_ns(now_ns) < self._least_gap_ns):
            return None
        return self._send(ZERO, now_ns)

    def move(self, wanted: BodyVelocity, now_ns: int, *, is_reduced: bool) -> BodyVelocity | None:
        """Next setpoint towards the wanted velocity, if one is due."""
        gap_ns = self._gap_ns(now_ns)
        if self.is_silent or gap_ns < self._least_gap_ns:
            return None
        limits = self._config.velocity
        most_m_s = self._config.reduced_speed_m_s if is_reduced else math.inf
        target = saturate(wanted, limits, most_m_s)
        dt_s = min(gap_ns, self._config.timing.slew_step_ns) / S
        return self._send(slew(self.last, target, dt_s, limits), now_ns)

    @property
    def _least_gap_ns(self) -> int:
        return self._config.timing.setpoint_gap_ns

    def _gap_ns(self, now_ns: int) -> int:
        """Time since the last setpoint; before the first one, long enough."""
        return self._config.timing.slew_step_ns if self._sent_ns is None else now_ns - self._sent_ns

    def _send(self, setpoint: BodyVelocity, now_ns: int) -> BodyVelocity:
        self.last = setpoint
        self._sent_ns = now_ns
        return setpoint
