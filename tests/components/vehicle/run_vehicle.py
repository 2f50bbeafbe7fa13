"""Run ``dfvs-sim vehicle`` with the options given."""

import argparse
import sys

from dfvs_sim.commands import vehicle

if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    vehicle.add_parser(parser.add_subparsers(required=True))
    args = parser.parse_args()
    sys.exit(args.run(args))
