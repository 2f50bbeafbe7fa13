"""The faults of ``faults.csv``, each with how it is caused and the setup that it needs."""

import csv
import functools
from pathlib import Path

from dfvs_core.gate.states import Cause, GateState
from dfvs_robustness.faults.commander_faults import COMMANDER_FAULTS
from dfvs_robustness.faults.fault import Fault, Reaction
from dfvs_robustness.faults.frame_faults import FRAME_FAULTS, NETWORK_FAULTS
from dfvs_robustness.faults.process_faults import PROCESS_FAULTS
from dfvs_robustness.faults.start_faults import SETUPS, START_FAULTS
from dfvs_robustness.faults.vehicle_faults import VEHICLE_FAULTS
from dfvs_robustness.harness.setup import NO_RESPONSE_CHECK, TEXTURE, Setup

_INJECTIONS = {
    **(FRAME_FAULTS | NETWORK_FAULTS | START_FAULTS),
    **(VEHICLE_FAULTS | COMMANDER_FAULTS | PROCESS_FAULTS),
}
_SETUPS = {
    **dict.fromkeys(FRAME_FAULTS, TEXTURE),
    **SETUPS,
    "foreign-commander": Setup(settings=(NO_RESPONSE_CHECK,)),
    "router-dies": Setup(via_router=True),
}


@functools.cache
def all_faults() -> dict[str, Fault]:
    """Every fault by its name, in the order of the table."""
    with Path(__file__).with_name("faults.csv").open(encoding="utf-8", newline="") as file:
        return {row["name"]: _fault(row) for row in csv.DictReader(file)}


def _fault(row: dict[str, str]) -> Fault:
    """Fault of a row: words are separated by spaces, what the gate may say by semicolons."""
    says = [text for text in row["says"].split("; ") if text]
    flags = row["flags"].split()
    return Fault(
        row["name"],
        row["what"],
        row["seen_by"],
        Reaction[row["reaction"]],
        float(row["limit_ms"]),
        tuple(GateState[state] for state in row["states"].split()),
        _INJECTIONS[row["name"]],
        _SETUPS.get(row["name"], Setup()),
        float(row["watch_s"]),
        restarts="restarts" in flags,
        spares_frames="spares_frames" in flags,
        alone="alone" in flags,
        cuts_link="cuts_link" in flags,
        says=tuple(Cause[text] if text in Cause.__members__ else text for text in says),
    )
