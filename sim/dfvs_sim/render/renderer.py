"""Renderer of the mock camera: colour and exact depth of a scene, without GPU or GL."""

from dataclasses import dataclass

import cv2
import numpy as np

from dfvs_core.geometry.arrays import Float32Array, FloatArray, ImageArray
from dfvs_core.geometry.camera import CameraModel
from dfvs_core.geometry.poses import check_pose, invert_pose
from dfvs_sim.render.clusters import Clusters, build_clusters
from dfvs_sim.render.geometry import cull_clusters, rasterise, transform_vertices
from dfvs_sim.render.lens import Lens, lens_of
from dfvs_sim.render.shading import attribute_planes, number_visible, shade, shade_antialiased
from dfvs_sim.scene.mesh import Int32Array, Scene
from dfvs_sim.scene.texture import linear_from_srgb, pack_textures, srgb_from_linear

NEAR_M = 0.02
_ENCODE_STEPS = 8192
_PLANE_REACH = 1.02


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """What a camera sees."""

    image: ImageArray
    """(H, W, 3) uint8: RGB."""
    depth_m: Float32Array
    """(H, W) float32: depth along the optical axis at each pixel's centre, m; 0 is sky."""


class Renderer:
    """Draws one scene from any pose; frames are a pure function of scene, camera and pose.

    ``render`` holds no state and releases the interpreter lock, so several threads may call it.
    Neither the scene nor its arrays may change afterwards.
    """

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self._clusters: Clusters = build_clusters(scene)
        steps = np.linspace(0.0, 1.0, _ENCODE_STEPS, dtype=np.float32)
        encode = np.rint(srgb_from_linear(steps) * 255.0).astype(np.uint8)
        decode = linear_from_srgb(np.arange(256, dtype=np.float32) / 255.0)
        pack = pack_textures(scene.textures)
        self._pack = (pack.texels, pack.levels, decode.astype(np.float64))
        self._colours = (np.array(scene.sky, dtype=np.float64), encode)

    def render(
        self, camera: CameraModel, T_world_camera: FloatArray, antialias: bool = False
    ) -> View:
        """Render one frame from ``T_world_camera`` (4, 4), the pose of the optical frame in NED.

        A distorted camera is rendered as a pinhole and remapped. With ``antialias`` the colour has
        four coverage samples a pixel; depth stays that of the pixel's centre.

        Raises
        ------
        GeometryError
            If the pose is not a rigid motion, or the camera sees too wide for a pinhole.
        """
        T_world_camera = check_pose(T_world_camera, "T_world_camera")
        if camera.distortion:
            return self._render_distorted(lens_of(camera), T_world_camera, antialias)
        clip, inverse_depth, ids = self._draw(camera, T_world_camera)
        depth = _depth(inverse_depth, ids)
        return View(self._paint(camera, T_world_camera, (clip, ids), antialias), depth)

    def depth(self, camera: CameraModel, T_world_camera: FloatArray) -> Float32Array:
        """Depth (H, W) m, as in ``View``, without the time for colour.

        Raises
        ------
        GeometryError
            As ``render``.
        """
        pose = check_pose(T_world_camera, "T_world_camera")
        if camera.distortion:
            lens = lens_of(camera)
            clip, _, ids = self._draw(lens.pinhole, pose)
            return self._depth_through(lens, clip, ids)
        _, inverse_depth, ids = self._draw(camera, pose)
        return _depth(inverse_depth, ids)

    def _render_distorted(self, lens: Lens, T_world_camera: FloatArray, antialias: bool) -> View:
        """Render the pinhole image behind a lens and look up the pixels in it."""
        clip, _, ids = self._draw(lens.pinhole, T_world_camera)
        depth = self._depth_through(lens, clip, ids.copy())
        image = self._paint(lens.pinhole, T_world_camera, (clip, ids), antialias)
        seen = cv2.remap(
            image, lens.x - 0.5, lens.y - 0.5, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
        )
        return View(np.asarray(seen, dtype=np.uint8), depth)

    def _depth_through(self, lens: Lens, clip: FloatArray, ids: Int32Array) -> Float32Array:
        """Depth (H, W) m of the triangles' planes just where a lens' pixels look."""
        planes, _ = self._surface(clip, ids)
        i, j = lens.x.astype(np.intp), lens.y.astype(np.intp)
        numbers = ids[j, i]
        if not len(planes):
            return np.zeros(numbers.shape, np.float32)
        S = planes[np.maximum(numbers, 0), 0]
        at_centre = S[..., 0] * (i + 0.5) + S[..., 1] * (j + 0.5) + S[..., 2]
        here = S[..., 0] * lens.x + S[..., 1] * lens.y + S[..., 2]
        here = np.clip(here, at_centre / _PLANE_REACH, at_centre * _PLANE_REACH)
        return _depth(here, numbers)

    def _paint(
        self,
        camera: CameraModel,
        T_world_camera: FloatArray,
        drawn: tuple[FloatArray, Int32Array],
        antialias: bool,
    ) -> ImageArray:
        """Colour a pinhole image (H, W, 3) of vertices and ids; the ids are used up."""
        clip, ids = drawn
        if antialias:
            fine = camera.scaled(2 * camera.width, 2 * camera.height)
            _, _, ids = self._draw(fine, T_world_camera)
        surface = self._surface(clip, ids)
        image = np.empty((camera.height, camera.width, 3), np.uint8)
        paint = shade_antialiased if antialias else shade
        paint(surface, self._pack, ids, self._colours, image)
        return image

    def _surface(self, clip: FloatArray, ids: Int32Array) -> tuple[FloatArray, Int32Array]:
        """Attributes of the triangles in ids (H, W), which become numbers into them."""
        c = self._clusters
        visible = np.empty(min(ids.size, len(c.triangles)), np.int32)
        numbers = np.full(len(c.triangles), -1, np.int32)
        visible = visible[: number_visible(ids, numbers, visible)]
        planes = np.empty((len(visible), 6, 3))
        mesh = (clip, c.triangles, self.scene.uv, self.scene.colours)
        attribute_planes(mesh, visible, planes)
        return planes, c.texture_index[visible]

    def _draw(
        self, camera: CameraModel, T_world_camera: FloatArray
    ) -> tuple[FloatArray, FloatArray, Int32Array]:
        """Vertices as (X, Y, W), z-buffer of 1 / depth, and the nearest triangle's index."""
        T_camera_world = invert_pose(T_world_camera)
        P = camera.matrix @ T_camera_world[:3]
        clip = np.empty((len(self.scene.vertices), 3))
        transform_vertices(self.scene.vertices, P, clip)
        inverse_depth = np.zeros((camera.height, camera.width))
        ids = np.full((camera.height, camera.width), -1, np.int32)
        ranges = self._visible_ranges(camera, P, T_world_camera[:3, 3])
        rasterise(clip, self._clusters.triangles, ranges, NEAR_M, inverse_depth, ids)
        return clip, inverse_depth, ids

    def _visible_ranges(self, camera: CameraModel, P: FloatArray, centre: FloatArray) -> Int32Array:
        """Runs of triangles (C, 2) that may be in view, the nearest first."""
        c = self._clusters
        planes = np.stack(
            [P[0], camera.width * P[2] - P[0], P[1], camera.height * P[2] - P[1], P[2]]
        )
        planes[4, 3] -= NEAR_M
        visible = np.empty(len(c.low), np.bool_)
        cull_clusters(c.low, c.high, planes, visible)
        nearest = np.clip(centre, c.low[visible], c.high[visible])
        distance = np.linalg.norm(nearest - centre, axis=1)
        order = np.argsort(distance, kind="stable")
        return np.ascontiguousarray(c.ranges[visible][order])


def _depth(inverse_depth: FloatArray, ids: Int32Array) -> Float32Array:
    """Depth (H, W) m from the z-buffer; 0 where no triangle is."""
    depth = np.zeros(ids.shape)
    np.divide(1.0, inverse_depth, out=depth, where=ids >= 0)
    return depth.astype(np.float32)
