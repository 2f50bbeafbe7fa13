"""Starts the real parent with the given perception and gate programs."""

import argparse
import sys
from pathlib import Path

from dfvs_service.settings.runtime import RuntimeFolder
from dfvs_service.supervisor.console import ChangeLines
from dfvs_service.supervisor.parent import Programs, fly


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--runtime", type=Path, required=True)
    parser.add_argument("--gate", default="")
    parser.add_argument("--perception", required=True)
    args = parser.parse_args()
    programs = Programs(perception=(sys.executable, *args.perception.split()))
    if args.gate:
        programs = Programs((sys.executable, *args.gate.split()), programs.perception)
    sys.exit(fly(RuntimeFolder(args.runtime), programs, ChangeLines(sys.stderr)))


if __name__ == "__main__":
    main()
