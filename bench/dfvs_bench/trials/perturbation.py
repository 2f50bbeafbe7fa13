"""Perturbations between goal image and flight: light, blur, occlusion, moved objects, noise.

The goal image is never perturbed, the frames are. ``light`` and ``moved`` change the scene,
the others the rendered frame. All draws come from the task's seed and the number of the frame.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Literal, get_args

import cv2
import numpy as np

from dfvs_bench.trials.task import BenchTask
from dfvs_core.errors import ConfigError
from dfvs_core.geometry.arrays import FloatArray, ImageArray
from dfvs_core.geometry.camera import homogeneous
from dfvs_sim.camera.sensor import SensorNoise
from dfvs_sim.render.renderer import Renderer, View
from dfvs_sim.scene.glb import load_glb
from dfvs_sim.scene.mesh import Scene, SceneError
from dfvs_sim.scene.objects import SceneObject, find_objects, move_vertices

Kind = Literal["light", "blur", "occlusion", "moved", "noise"]
Strength = Literal["mild", "medium", "strong"]
KINDS: tuple[Kind, ...] = get_args(Kind)
STRENGTHS: tuple[Strength, ...] = get_args(Strength)

AMBIENT: dict[Strength, float] = {"mild": 0.6, "medium": 0.35, "strong": 0.15}
"""Share of the baked light that stays."""
LAMP: dict[Strength, float] = {"mild": 0.5, "medium": 1.0, "strong": 1.5}
"""Share of the baked light that a lamp adds to what is close to it."""
BLUR: dict[Strength, float] = {"mild": 1 / 320, "medium": 2 / 320, "strong": 3 / 320}
"""Standard deviation of the blur over the image's width."""
OCCLUDED: dict[Strength, float] = {"mild": 0.05, "medium": 0.15, "strong": 0.3}
"""Share of the image that is occluded."""
MOVED: dict[Strength, float] = {"mild": 0.1, "medium": 0.2, "strong": 0.3}
"""Share of the goal view whose objects are moved, as far as it shows objects."""
MOVED_M: dict[Strength, float] = {"mild": 0.1, "medium": 0.25, "strong": 0.5}
"""Distance by which each object is moved."""
NOISE: dict[Strength, float] = {"mild": 5.0, "medium": 10.0, "strong": 20.0}
"""Standard deviation of the noise, grey levels."""

_LAMP_RADIUS_M = 1.0
_LAMP_REACH_M = 1.5
_LAMP_COLOUR = np.array([1.3, 1.0, 0.6])
_OCCLUDER_DEPTH_M = 0.3
_OCCLUDER_PATCHES = (6, 8)
_OCCLUDER_PERIODS = (37.0, 53.0)
"""Frames that the occluder takes for a swing across the image, and along it."""
_POINTS_STRIDE_PX = 4
_CLEARANCE_M = 0.3
"""Between a moved object and the straight line from start to goal."""
_WAYS_TRIED = 8
_FLAT_M = 0.12
"""Thickness of an object that hangs at a wall and is moved along it."""

Disturbance = Callable[[int, View], View]
"""Makes of a rendered view, by the number of its frame, what the method is given."""


@dataclass(frozen=True, slots=True)
class Perturbation:
    """A kind of perturbation and its strength."""

    kind: Kind
    strength: Strength = "medium"

    @property
    def name(self) -> str:
        """Such as ``light-strong``."""
        return f"{self.kind}-{self.strength}"

    def generator(self, task: BenchTask) -> np.random.Generator:
        """Random source of a task; the same for all strengths."""
        return np.random.default_rng([task.seed or 0, KINDS.index(self.kind)])


PERTURBATIONS = {p.name: p for p in (Perturbation(k, s) for k in KINDS for s in STRENGTHS)}
"""All by their names, in the order of tables."""


def parse_perturbations(names: str) -> list[Perturbation]:
    """Perturbations of a list such as ``light,noise-strong``; a kind alone is of medium strength.

    Raises
    ------
    ConfigError
        If there is no such perturbation.
    """
    known = PERTURBATIONS | {kind: Perturbation(kind) for kind in KINDS}
    for name in names.split(","):
        if name not in known:
            raise ConfigError(
                f"there is no perturbation {name!r}",
                f"{', '.join(KINDS)}, each alone or with {', '.join('-' + s for s in STRENGTHS)}",
            )
    return list(dict.fromkeys(known[name] for name in names.split(",")))


def perturbed_renderer(perturbation: Perturbation, task: BenchTask, renderer: Renderer) -> Renderer:
    """Renderer of the scene that is flown in; the same one where the scene does not change.

    Raises
    ------
    SceneError
        If the goal shows no object that could be moved.
    """
    if perturbation.kind == "light":
        return Renderer(_relit(renderer.scene, perturbation, task))
    if perturbation.kind == "moved":
        return Renderer(_rearranged(renderer, perturbation, task))
    return renderer


def check_perturbations(perturbations: Sequence[Perturbation], tasks: Sequence[BenchTask]) -> None:
    """Refuse tasks that could not be perturbed, before any is tried.

    Raises
    ------
    DfvsError
        If a goal shows no object that could be moved.
    """
    for perturbation in perturbations:
        for task in tasks if perturbation.kind == "moved" else ():
            _rearranged(Renderer(load_glb(task.scene)), perturbation, task)


def disturbance(perturbation: Perturbation, task: BenchTask) -> Disturbance:
    """Disturbance of the frames of a task; the frame itself where only the scene changes."""
    rng, strength = perturbation.generator(task), perturbation.strength
    if perturbation.kind == "blur":
        return lambda _, view: _blurred(view, BLUR[strength])
    if perturbation.kind == "occlusion":
        return _Occluder(task.camera.size, OCCLUDED[strength], rng)
    if perturbation.kind == "noise":
        seed = int(rng.integers(2**32))
        noise = SensorNoise.make(task.camera.size, NOISE[strength], rng)

        def noisy(index: int, view: View) -> View:
            return replace(
                view, image=noise.apply(view.image, np.random.default_rng([seed, index]))
            )

        return noisy
    return undisturbed


def undisturbed(_: int, view: View) -> View:
    """The view as it was rendered."""
    return view


def _relit(scene: Scene, perturbation: Perturbation, task: BenchTask) -> Scene:
    """The scene with its baked light dimmed and a warm lamp somewhere near start and goal."""
    rng = perturbation.generator(task)
    places = np.stack([task.T_world_start[:3, 3], task.T_world_goal[:3, 3]])
    reach = np.array([_LAMP_REACH_M, _LAMP_REACH_M, 0.0])
    lamp = rng.uniform(places.min(axis=0) - reach, places.max(axis=0) + reach)
    distance_m = np.linalg.norm(scene.vertices - lamp, axis=1)
    falloff = 1.0 / (1.0 + (distance_m / _LAMP_RADIUS_M) ** 2)
    ambient = AMBIENT[perturbation.strength]
    factor = ambient + LAMP[perturbation.strength] * falloff[:, None] * _LAMP_COLOUR
    colours = (scene.colours * factor).astype(np.float32)
    red, green, blue = (ambient * part for part in scene.sky)
    return replace(scene, colours=colours, sky=(red, green, blue))


def _rearranged(renderer: Renderer, perturbation: Perturbation, task: BenchTask) -> Scene:
    """The scene with objects of the goal view shifted over the floor, or along their wall."""
    rng, strength = perturbation.generator(task), perturbation.strength
    points = _goal_points(renderer, task)
    objects = find_objects(renderer.scene)
    seen = [float(thing.holds(points).mean()) for thing in objects]
    scene, share = renderer.scene, 0.0
    for k in rng.permutation(len(objects)):
        if not seen[k] or share >= MOVED[strength]:
            continue
        others = [thing for j, thing in enumerate(objects) if j != k]
        by_m = _free_shift(objects[k], others, task, MOVED_M[strength], rng)
        if by_m is not None:
            scene = move_vertices(scene, objects[k].vertices, by_m)
            objects[k] = objects[k].shifted(by_m)
            share += seen[k]
    if not share:
        raise SceneError(
            f"the goal of task {task.name!r} shows no object that could be moved",
            "a scene whose furniture is not one mesh with its walls",
            "leave out --perturb moved",
        )
    return scene


def _goal_points(renderer: Renderer, task: BenchTask) -> FloatArray:
    """Points (N, 3) in NED that the goal view shows."""
    grid = (slice(None, None, _POINTS_STRIDE_PX),) * 2
    z_m = renderer.depth(task.camera, task.T_world_goal)[grid].ravel()
    xy = task.camera.normalise(task.camera.grid()[grid].reshape(-1, 2))
    points = (homogeneous(xy) * z_m[:, None])[z_m > 0]
    R, t = task.T_world_goal[:3, :3], task.T_world_goal[:3, 3]
    found: FloatArray = points @ R.T + t
    return found


def _free_shift(
    thing: SceneObject,
    others: list[SceneObject],
    task: BenchTask,
    distance_m: float,
    rng: np.random.Generator,
) -> FloatArray | None:
    """Horizontal shift (3,) by a distance in m that hits no other object and leaves the way free.

    Objects move towards the middle of the way rather than away from it, where the walls are.
    """
    start, goal = task.T_world_start[:3, 3], task.T_world_goal[:3, 3]
    way = np.linspace(start, goal, 20)
    size = thing.high - thing.low
    inwards = (0.5 * (start + goal) - 0.5 * (thing.low + thing.high))[:2]
    for _ in range(_WAYS_TRIED):
        angle = math.atan2(inwards[1], inwards[0]) + rng.uniform(-0.4, 0.4) * math.pi
        if size[:2].min() < _FLAT_M:
            angle = 0.5 * math.pi * float(size[1] > size[0]) + math.pi * float(rng.integers(2))
        by_m = distance_m * np.array([math.cos(angle), math.sin(angle), 0.0])
        there = thing.shifted(by_m)
        away = np.maximum(np.maximum(there.low - way, way - there.high), 0.0)
        is_free = np.linalg.norm(away, axis=1).min() >= _CLEARANCE_M
        if is_free and not any(there.overlaps(other) for other in others):
            return by_m
    return None


def _blurred(view: View, share: float) -> View:
    sigma_px = share * view.image.shape[1]
    image = cv2.GaussianBlur(view.image, (0, 0), sigma_px)
    return replace(view, image=np.asarray(image, np.uint8))


class _Occluder:
    """A patterned disc close before the camera, which swings across the image.

    The depth sensor sees it, too.
    """

    def __init__(self, size: tuple[int, int], share: float, rng: np.random.Generator) -> None:
        self._size = size
        self._radius_px = math.sqrt(share * size[0] * size[1] / math.pi)
        self._phase = rng.uniform(0.0, 2.0 * math.pi, 2)
        patches = rng.integers(0, 256, (*_OCCLUDER_PATCHES, 3)).astype(np.uint8)
        side = math.ceil(2.0 * self._radius_px)
        pattern = cv2.resize(patches, (side, side), interpolation=cv2.INTER_NEAREST)
        self._pattern: ImageArray = np.asarray(pattern, np.uint8)

    def __call__(self, index: int, view: View) -> View:
        """The view (H, W) with the disc in front of it."""
        height, width = view.depth_m.shape
        swing = np.sin(2.0 * math.pi * index / np.array(_OCCLUDER_PERIODS) + self._phase)
        # The whole disc stays in the image, so that it always occludes the same share of it.
        room = np.maximum(np.array([width, height]) / 2.0 - self._radius_px, 0.0)
        x, y = np.array([width, height]) / 2.0 + swing * room
        u, v = np.arange(width) + 0.5 - x, np.arange(height)[:, None] + 0.5 - y
        hidden = u * u + v * v <= self._radius_px**2
        rows, columns = np.nonzero(hidden)
        side = len(self._pattern)
        j = np.clip(rows + 0.5 - y + self._radius_px, 0, side - 1).astype(np.intp)
        i = np.clip(columns + 0.5 - x + self._radius_px, 0, side - 1).astype(np.intp)
        image, depth_m = view.image.copy(), view.depth_m.copy()
        image[hidden] = self._pattern[j, i]
        depth_m[hidden] = np.minimum(
            np.where(depth_m[hidden] > 0, depth_m[hidden], np.inf), _OCCLUDER_DEPTH_M
        )
        return View(image, depth_m)
