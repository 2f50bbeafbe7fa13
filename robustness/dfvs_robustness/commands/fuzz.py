"""``dfvs-robustness fuzz``: what must hold whatever comes in, tried by the million."""

from typing import Any

from dfvs_robustness.commands import fuzz_frames
from dfvs_robustness.commands.fuzz_commands import FUZZ_COMMANDS
from dfvs_robustness.commands.fuzz_gate import FUZZ_GATE


def add_parser(subparsers: Any) -> None:
    """Add ``fuzz`` and its own subcommands to those of ``dfvs-robustness``."""
    parser = subparsers.add_parser(
        "fuzz",
        help="random inputs for the gate, hostile commands for its ingress, frames for the decoder",
        description="Try to break the gate's invariants with random inputs, the operator link "
        "with hostile commands, or the decoder with hostile frames.",
    )
    inner = parser.add_subparsers(metavar="WHAT", required=True)
    FUZZ_GATE.add_parser(inner)
    FUZZ_COMMANDS.add_parser(inner)
    fuzz_frames.add_parser(inner)
