"""Daylight from above, for places without a roof."""

from dataclasses import dataclass

import numpy as np

from dfvs_core.geometry.arrays import FloatArray


@dataclass(frozen=True, slots=True)
class Sky:
    """Sun and sky over a place without a roof, in room axes (z up).

    Parameters
    ----------
    sun_azimuth_deg, sun_height_deg : float
        Where the sun stands: from east to north, and above the horizon.
    sun_irradiance : tuple of float
        Red, green and blue on a surface that faces the sun.
    radiance : tuple of float
        Red, green and blue of the sky, everywhere the same.
    """

    sun_azimuth_deg: float
    sun_height_deg: float
    sun_irradiance: tuple[float, float, float] = (24.0, 21.5, 17.5)
    radiance: tuple[float, float, float] = (2.6, 3.1, 4.0)

    @property
    def to_sun(self) -> FloatArray:
        """Unit vector (3,) to the sun."""
        azimuth, height = np.radians([self.sun_azimuth_deg, self.sun_height_deg])
        level = np.cos(height)
        return np.array([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(height)])
