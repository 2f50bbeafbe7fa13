"""``dfvs-robustness fuzz frames``: hostile camera frames through the whole decoder."""

import argparse
from pathlib import Path
from typing import Any

import numpy as np

from dfvs_common.command_line import require_file, require_range
from dfvs_core.errors import ConfigError
from dfvs_robustness.commands.fuzz_run import ProgressLine
from dfvs_robustness.fuzz.frames.decoding import FrameOutcome, corpus_of, feed_all, hostile_frame
from dfvs_sim.options import write_json

MOST_TIME = 20.0
"""Longest time of any frame, as a multiple of the 99th percentile of good ones."""
MOST_PEAK_KIB = 2048
"""Largest peak of memory of any frame: an image of 320 x 240 px takes 225 KiB, several times."""
MOST_GROWTH_KIB = 4096
"""Largest growth of a process over all its frames."""

_EPILOG = """examples:
  dfvs-robustness fuzz frames --count 100000 --json frames.json
  dfvs-robustness fuzz frames --show 4711 --out .    write frame 4711 of seed 0 to files

exit code: 0 the decoder stood it, 1 it did not, 2 cannot run
"""


def add_parser(subparsers: Any) -> None:
    """Add ``frames`` to the subcommands of ``dfvs-robustness fuzz``."""
    parser = subparsers.add_parser(
        "frames",
        help="hostile frames for the decoder",
        description="Feed hostile frames (bombs, broken, mislabelled and oddly coded images, "
        "wrong headers) to the decoder that perception uses. Nothing but its own refusal may "
        "come back, and no frame may take much more time or memory than a good one.",
        epilog=_EPILOG,
    )
    add = parser.add_argument
    add("--count", type=int, default=100_000, metavar="N", help="number of frames")
    add("--workers", type=int, default=1, metavar="N", help="processes (default: 1)")
    add("--seed", type=int, default=0, help="of all that is random")
    add("--show", type=int, metavar="NUMBER", help="write one frame's bytes to files instead")
    add("--out", type=Path, default=Path(), metavar="DIR", help="folder for these files")
    add("--json", type=Path, metavar="FILE", help="write the figures there")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Feed frames or write one; 0 if all bounds held, else 1."""
    require_range(args, 1, None, "count", "workers")
    require_range(args, 0, None, "seed", "show")
    require_file("--json", args.json)
    if args.show is not None:
        return _show(args)
    line = ProgressLine()

    def tell(so_far: FrameOutcome) -> None:
        flaws = len(so_far.flaws)
        line.show(f"{so_far.frames:,} of {args.count:,} frames, {flaws} flaws")

    outcome = feed_all(args.count, args.workers, args.seed, tell)
    report = figures(outcome, args.seed)
    _print(report)
    if args.json is not None:
        write_json(args.json, report)
    return 0 if report["verdict"] == "passed" else 1


def figures(outcome: FrameOutcome, seed: int) -> dict[str, Any]:
    """What is written as JSON; times are processor time of the decoding thread.

    Without a good frame to compare with, its time and the ratio are None, and the verdict failed.
    """
    kinds = {
        kind: {
            "frames": tally.count,
            "admitted": tally.admitted,
            "p50_ms": round(float(np.median(tally.times_ms)), 3),
            "max_ms": round(tally.max_ms, 2),
            "max_peak_kib": tally.max_peak_kib,
        }
        for kind, tally in sorted(outcome.kinds.items())
    }
    good = outcome.kinds["good"].times_ms
    good_ms = float(np.percentile(good, 99)) if good else None
    slowest_ms = max((tally.max_ms for tally in outcome.kinds.values()), default=0.0)
    peak_kib = max((tally.max_peak_kib for tally in outcome.kinds.values()), default=0)
    report: dict[str, Any] = {
        "seed": seed,
        "frames": outcome.frames,
        "admitted": sum(tally.admitted for tally in outcome.kinds.values()),
        "good_p99_ms": None if good_ms is None else round(good_ms, 3),
        "slowest_over_good": None if good_ms is None else round(slowest_ms / good_ms, 2),
        "max_peak_kib": peak_kib,
        "growth_kib": outcome.growth_kib,
        "bounds": {
            "slowest_over_good": MOST_TIME,
            "max_peak_kib": MOST_PEAK_KIB,
            "growth_kib": MOST_GROWTH_KIB,
        },
        "kinds": kinds,
        "flaws": [{"frame": n, "kind": kind, "flaw": flaw} for n, kind, flaw in outcome.flaws],
    }
    found = [(report[name], bound) for name, bound in report["bounds"].items()]
    within = all(value is not None and value <= bound for value, bound in found)
    return report | {"verdict": "passed" if within and not outcome.flaws else "failed"}


def _print(report: dict[str, Any]) -> None:
    print(
        f"{'kind':26s}{'frames':>9s}{'admitted':>10s}{'p50 ms':>9s}{'max ms':>9s}{'peak KiB':>10s}"
    )
    for kind, row in report["kinds"].items():
        print(
            f"{kind:26s}{row['frames']:9,}{row['admitted']:10,}{row['p50_ms']:9.3f}"
            f"{row['max_ms']:9.2f}{row['max_peak_kib']:10,}"
        )
    for flaw in report["flaws"]:
        print(f"frame {flaw['frame']} ({flaw['kind']}): {flaw['flaw']}")
    ratio = report["slowest_over_good"]
    slowest = "no good frame" if ratio is None else f"slowest {ratio:g} times a good one"
    print(
        f"{report['frames']:,} frames, {len(report['flaws'])} flaws; {slowest}, "
        f"peak {report['max_peak_kib']:,} KiB, growth {report['growth_kib']:,} KiB: "
        f"{report['verdict']}"
    )


def _show(args: argparse.Namespace) -> int:
    frame = hostile_frame(corpus_of(args.seed), args.seed, args.show)
    try:
        for name, data in (("payload", frame.payload), ("attachment", frame.attachment)):
            path = args.out / f"frame-{args.show}.{name}"
            path.write_bytes(data)
            print(f"{frame.kind}: {path}, {len(data)} bytes")
    except OSError as error:
        raise ConfigError(f"cannot write into {args.out} ({error.strerror})", "a folder") from error
    return 0
