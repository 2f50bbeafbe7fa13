"""What ``dfvs-export bench`` does; it needs no torch."""

import argparse
import json
from dataclasses import asdict

from dfvs_common.atomic_file import replace_file
from dfvs_common.command_line import require_file
from dfvs_export.checks.timing import BenchPlan, bench
from dfvs_export.commands.network_size import network_size
from dfvs_models.catalog import bundle_folder


def run(arguments: argparse.Namespace) -> int:
    """Measure bundles side by side."""
    require_file("--json", arguments.json)
    plan = BenchPlan(network_size(arguments.size), arguments.threads, arguments.runs)
    results = bench([bundle_folder(name) for name in arguments.bundles], plan)
    for r in results:
        print(
            f"{r.bundle:24} {r.precision}  median {r.median_ms:8.1f} ms  p99 {r.p99_ms:8.1f} ms"
            f"  {r.resident_mb:7.1f} MB"
        )
    if arguments.json:
        text = json.dumps([asdict(r) for r in results], indent=2) + "\n"
        replace_file(arguments.json, text.encode())
    return 0
