"""The first way of a vehicle that was let go.

Its motion has to show that the error falls, and the error leaps when depth becomes known: by 0.1 to
0.4 m within a second in rooms. So no depth is learnt on the way.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dfvs_core.arrays import FloatArray

SETTING_OUT_M, SETTING_OUT_NS = 0.1, 3_000_000_000
"""How long the way is, and how long it takes at most."""


@dataclass(slots=True)
class SettingOut:
    """Follows a vehicle from where it was first let go; what comes after a hold is no new start."""

    _let_go: tuple[int, FloatArray] | None = None
    _is_over: bool = False

    @property
    def has_begun(self) -> bool:
        """Whether the vehicle was ever let go."""
        return self._let_go is not None

    def follow(self, engaged: bool, t_ns: int, position_m: FloatArray) -> None:
        """Take a frame's time, and where (3,) the camera was by odometry."""
        if self._let_go is None:
            self._let_go = (t_ns, position_m) if engaged else None
            return
        begun_ns, from_m = self._let_go
        way_m = float(np.linalg.norm(position_m - from_m))
        self._is_over |= way_m >= SETTING_OUT_M or t_ns - begun_ns >= SETTING_OUT_NS

    @property
    def is_under_way(self) -> bool:
        """Whether the vehicle was let go and the way is not over."""
        return self.has_begun and not self._is_over
