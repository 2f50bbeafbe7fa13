"""``dfvs-rooms room``: make a furnished room with its light baked in."""

import argparse
import json
import sys
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from dfvs_common.command_line import require_file, require_range
from dfvs_core.geometry.arrays import FloatArray
from dfvs_core.geometry.camera import CameraModel
from dfvs_core.messages.image import encode_png
from dfvs_rooms.generator.room import Room
from dfvs_rooms.lighting.bake import bake_room, light_room
from dfvs_rooms.lighting.path_traced import BakeSettings, load_mitsuba
from dfvs_rooms.room_types.living_room import HEIGHT_M, LENGTH_M, VIEWS, WIDTH_M
from dfvs_rooms.room_types.room_types import LIVING_ROOM, REPETITIVE_KINDS, ROOM_KINDS, room_of_kind
from dfvs_sim.render.renderer import Renderer
from dfvs_sim.scene.frames import gltf_from_ned
from dfvs_sim.scene.glb_writer import save_glb
from dfvs_sim.scene.mesh import Scene
from dfvs_sim.viewpoints.poses import look_at
from dfvs_sim.viewpoints.sampling import floor_of

_View: TypeAlias = tuple[tuple[float, float, float], tuple[float, float, float]]
"""Eye and point looked at, in the scene file's axes, m."""
_EYE_HEIGHT_M, _LOOK_HEIGHT_M = 1.6, 1.0
_CORNERS = {
    "north-east": np.array([1.0, 1.0]),
    "south-east": np.array([-1.0, 1.0]),
    "south-west": np.array([-1.0, -1.0]),
    "north-west": np.array([1.0, -1.0]),
}
_PREVIEW_SIZE = (1280, 960)
_PREVIEW_FOV_RAD = 1.309
_EPILOG = """examples:
  dfvs-rooms room --seed 3 --samples 256 --out room.glb --preview room.png
  dfvs-rooms room --kind hall --seed 5 --light quick --out hall.glb
"""


def add_parser(subparsers: Any) -> None:
    """Add ``room`` to the subcommands of ``dfvs-rooms``."""
    parser = subparsers.add_parser(
        "room",
        help="make a furnished room",
        description="Furnish a room from a seed, light it and write it as GLB, with a JSON file of "
        "its size and good views beside it. Traced light takes minutes and Mitsuba 3 (the extra "
        "[bake]), quick light seconds. The living room is one plan in many patterns; everything "
        "in the other kinds is drawn. In an arcade everything comes again and again, so that "
        "places are taken for others.",
        epilog=_EPILOG,
    )
    add = parser.add_argument
    add("--kind", choices=ROOM_KINDS + REPETITIVE_KINDS, default=LIVING_ROOM)
    add("--seed", type=int, required=True, help="chooses patterns and furniture")
    add("--out", type=Path, required=True, metavar="FILE", help="scene to write (.glb)")
    add("--light", choices=("traced", "quick"), default="traced", help="default: traced")
    add("--samples", type=int, default=256, metavar="N", help="traced light paths a vertex")
    add("--preview", type=Path, metavar="FILE", help="image of the room to write (.png)")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Make the room; exit code 0."""
    require_range(args, 0, None, "seed")
    for option, path, ending in (("--out", args.out, ".glb"), ("--preview", args.preview, ".png")):
        require_file(option, path, ending)
    settings = BakeSettings(samples=args.samples, seed=args.seed)
    if args.light == "traced":
        load_mitsuba()
    room = room_of_kind(args.kind, args.seed)
    scene = _lit(room, args, settings)
    save_glb(args.out, scene)
    views = VIEWS if args.kind == LIVING_ROOM else _corner_views(scene)
    description = args.out.with_suffix(".json")
    text = json.dumps(_description(args, room, scene, views), indent=2)
    description.write_text(text + "\n", encoding="utf-8")
    print(f"wrote {args.out} ({len(scene.triangles)} triangles) and {description}")
    if args.preview is not None:
        args.preview.write_bytes(_preview(scene, next(iter(views.values()))))
        print(f"wrote {args.preview}")
    return 0


def _lit(room: Room, args: argparse.Namespace, settings: BakeSettings) -> Scene:
    """Light a room as it was asked for."""
    if args.light == "quick":
        return light_room(room, args.seed)
    scene = bake_room(room, settings, _show_progress)
    print(file=sys.stderr)
    return scene


def _show_progress(done: int, total: int) -> None:
    print(f"\rlight: {done} of {total} points", end="", file=sys.stderr, flush=True)


def _corner_views(scene: Scene) -> dict[str, _View]:
    """Views of a drawn interior from above its corners to its middle."""
    floor_m, low, high = floor_of(scene)
    middle, reach = 0.5 * (low + high), 0.42 * (high - low)
    target = gltf_from_ned(np.array([*middle, floor_m - _LOOK_HEIGHT_M]))
    views = {}
    for name, corner in _CORNERS.items():
        eye = gltf_from_ned(np.array([*(middle + reach * corner), floor_m - _EYE_HEIGHT_M]))
        views[name] = (_triple(eye), _triple(target))
    return views


def _triple(point: FloatArray) -> tuple[float, float, float]:
    x, y, z = (round(float(v), 3) for v in point)
    return x, y, z


def _description(
    args: argparse.Namespace, room: Room, scene: Scene, views: dict[str, _View]
) -> dict[str, Any]:
    """What stands in the JSON file beside a room."""
    _, low, high = floor_of(scene)
    size = {"east_west": float(high[1] - low[1]), "north_south": float(high[0] - low[0])}
    solid = [part for part in room.parts if not room.materials[part.material].shines]
    height = max(float(part.vertices[:, 2].max()) for part in solid)
    if args.kind == LIVING_ROOM:  # its view outside reaches beyond its walls
        size, height = {"east_west": LENGTH_M, "north_south": WIDTH_M}, HEIGHT_M
    return {
        "kind": args.kind,
        "seed": args.seed,
        "light": args.light,
        "samples": args.samples if args.light == "traced" else None,
        "size_m": {
            **{name: round(value, 3) for name, value in size.items()},
            "height": round(height, 3),
        },
        "floor_down_m": 0.0,
        "views": {
            name: {"eye_gltf_m": eye, "look_at_gltf_m": target}
            for name, (eye, target) in views.items()
        },
    }


def _preview(scene: Scene, view: _View) -> bytes:
    """PNG of a view."""
    camera = CameraModel.from_horizontal_fov(*_PREVIEW_SIZE, _PREVIEW_FOV_RAD)
    image = Renderer(scene).render(camera, look_at(*view), antialias=True).image
    return encode_png(image)
