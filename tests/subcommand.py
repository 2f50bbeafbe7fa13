"""One subcommand of a command line, run in this process."""

import argparse


def run_subcommand(module, *words):
    """Exit code of the subcommand that a module adds; its errors are raised."""
    parser = argparse.ArgumentParser()
    module.add_parser(parser.add_subparsers())
    name = module.__name__.rpartition(".")[2].replace("_", "-")
    args = parser.parse_args([name, *map(str, words)])
    return args.run(args)
