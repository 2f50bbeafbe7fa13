"""A scene: a triangle mesh with textures and baked light, in NED."""

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from dfvs_core.errors import DfvsError
from dfvs_core.geometry.arrays import Float32Array, FloatArray
from dfvs_sim.scene.texture import Texture

Int32Array: TypeAlias = NDArray[np.int32]
NO_TEXTURE = -1


class SceneError(DfvsError):
    """A scene that cannot be drawn."""


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """Triangles to look at. What is seen is texture x vertex colour, nothing else."""

    vertices: Float32Array
    """(N, 3) float32: positions in NED, m."""
    triangles: Int32Array
    """(M, 3) int32: vertex indices; both sides of a triangle are visible."""
    uv: Float32Array
    """(N, 2) float32: texture coordinates, (0, 0) at the first texel's outer corner, v downwards.
    """
    colours: Float32Array
    """(N, 3) float32: linear light: material colour x baked light."""
    texture_index: Int32Array
    """(M,) int32: texture of each triangle, or ``NO_TEXTURE``."""
    textures: tuple[Texture, ...] = ()
    sky: tuple[float, float, float] = (0.42, 0.58, 0.78)
    """Linear light seen where there is no triangle."""

    def __post_init__(self) -> None:
        """Refuse a mesh whose arrays do not fit together: the renderer trusts them."""
        n, m = len(self.vertices), len(self.triangles)
        shapes = {
            "vertices": (self.vertices, (n, 3), np.float32),
            "triangles": (self.triangles, (m, 3), np.int32),
            "uv": (self.uv, (n, 2), np.float32),
            "colours": (self.colours, (n, 3), np.float32),
            "texture_index": (self.texture_index, (m,), np.int32),
        }
        for name, (array, shape, dtype) in shapes.items():
            if array.shape != shape or array.dtype != dtype:
                raise SceneError(
                    f"scene {name} are {array.dtype} of shape {array.shape}",
                    f"{np.dtype(dtype)} of {shape}",
                )
        if m == 0:
            raise SceneError("the scene has no triangles", "at least one")
        for name, (array, _, _) in shapes.items():
            if not np.isfinite(array).all():
                raise SceneError(f"scene {name} hold values that are not finite")
        self._check_indices()

    def _check_indices(self) -> None:
        """Check that no index points outside its array."""
        if self.triangles.min() < 0 or self.triangles.max() >= len(self.vertices):
            raise SceneError(
                f"vertex indices run from {self.triangles.min()} to {self.triangles.max()}",
                f"0 to {len(self.vertices) - 1}",
            )
        low, high = int(self.texture_index.min()), int(self.texture_index.max())
        if low < NO_TEXTURE or high >= len(self.textures):
            raise SceneError(
                f"texture indices run from {low} to {high}",
                f"{NO_TEXTURE} to {len(self.textures) - 1}",
            )

    @property
    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Lowest and highest corner (3,), (3,) in NED, m, of all vertices that are used."""
        used = self.vertices[np.unique(self.triangles)].astype(np.float64)
        return used.min(axis=0), used.max(axis=0)
