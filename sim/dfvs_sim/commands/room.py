"""``dfvs-sim room``: make a furnished room with path-traced light."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

from dfvs_core.camera import CameraModel
from dfvs_core.errors import ConfigError
from dfvs_core.wire.picture import encode_png
from dfvs_sim.render.renderer import Renderer
from dfvs_sim.scene.bake import bake_room
from dfvs_sim.scene.glb_writer import save_glb
from dfvs_sim.scene.light import BakeSettings, load_mitsuba
from dfvs_sim.scene.mesh import Scene
from dfvs_sim.scene.poses import look_at
from dfvs_sim.scene.room import HEIGHT_M, LENGTH_M, VIEWS, WIDTH_M, furnished_room

_PREVIEW_SIZE = (1280, 960)
_PREVIEW_FOV_RAD = 1.309
_EPILOG = """example:
  dfvs-sim room --seed 3 --samples 256 --out room.glb --preview room.png
"""


def add_parser(subparsers: Any) -> None:
    """Add ``room`` to the subcommands of ``dfvs-sim``."""
    parser = subparsers.add_parser(
        "room",
        help="make a furnished room (needs the extra [bake])",
        description="Furnish a living room from a seed, trace its light with Mitsuba 3 and write "
        "it as GLB, with a JSON file of its size and good views beside it. Minutes of work.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add = parser.add_argument
    add("--seed", type=int, required=True, help="chooses patterns, paintings, books and plants")
    add("--out", type=Path, required=True, metavar="FILE", help="scene to write (.glb)")
    add("--samples", type=int, default=256, metavar="N", help="light paths a vertex")
    add("--preview", type=Path, metavar="FILE", help="picture of the room to write (.png)")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Make the room; exit code 0.

    Raises
    ------
    DfvsError
        If an option cannot be used or Mitsuba is not installed.
    """
    if args.seed < 0:
        raise ConfigError(f"--seed is {args.seed}", "0 or more")
    for path, ending in ((args.out, ".glb"), (args.preview, ".png")):
        _check_output(path, ending)
    settings = BakeSettings(samples=args.samples, seed=args.seed)
    load_mitsuba()
    scene = bake_room(furnished_room(args.seed), settings, _show_progress)
    print(file=sys.stderr)
    save_glb(args.out, scene)
    description = args.out.with_suffix(".json")
    description.write_text(json.dumps(_description(args), indent=2) + "\n", encoding="utf-8")
    print(f"wrote {args.out} ({len(scene.triangles)} triangles) and {description}")
    if args.preview is not None:
        args.preview.write_bytes(_preview(scene))
        print(f"wrote {args.preview}")
    return 0


def _check_output(path: Path | None, ending: str) -> None:
    """Refuse an output that could not be written after minutes of work."""
    if path is None:
        return
    if path.suffix.lower() != ending:
        raise ConfigError(f"the output is {str(path)!r}", f"a name that ends in {ending}")
    if not path.absolute().parent.is_dir():
        raise ConfigError(f"{path} lies in no folder", "an existing folder")


def _show_progress(done: int, total: int) -> None:
    print(f"\rlight: {done} of {total} points", end="", file=sys.stderr, flush=True)


def _description(args: argparse.Namespace) -> dict[str, Any]:
    """What stands in the JSON file beside a room."""
    return {
        "seed": args.seed,
        "samples": args.samples,
        "size_m": {"east_west": LENGTH_M, "north_south": WIDTH_M, "height": HEIGHT_M},
        "floor_down_m": 0.0,
        "views": {
            name: {"eye_gltf_m": eye, "look_at_gltf_m": target}
            for name, (eye, target) in VIEWS.items()
        },
    }


def _preview(scene: Scene) -> bytes:
    """PNG of the first view."""
    eye, target = next(iter(VIEWS.values()))
    camera = CameraModel.from_horizontal_fov(*_PREVIEW_SIZE, _PREVIEW_FOV_RAD)
    view = Renderer(scene).render(camera, look_at(eye, target), antialias=True)
    return encode_png(view.image)
