"""Stands in for the gate: shows signs of life, and ends as it is told on the command line.

``--code N`` ends with that code after half a second; ``--hang`` falls silent then, and ``--crash``
is killed; ``--after NAME`` waits for that file of the runtime folder instead. ``--told N`` is the
code of its end by SIGTERM, which ``--deaf`` ignores. ``--refuses TEXT`` has a check refuse, and the
time of its heartbeats run ten times as fast.
"""

import argparse
import os
import signal
import socket
import sys
import time
from dataclasses import replace
from pathlib import Path

from dfvs_core.gate.checks.preflight import Check
from dfvs_core.messages.schema import to_json
from dfvs_service.supervisor.heartbeat import Heartbeat


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--runtime", type=Path, required=True)
    parser.add_argument("--code", type=int)
    parser.add_argument("--told", type=int, default=1)
    parser.add_argument("--after")
    parser.add_argument("--deaf", action="store_true")
    parser.add_argument("--hang", action="store_true")
    parser.add_argument("--crash", action="store_true")
    parser.add_argument("--state", default="PREFLIGHT")
    parser.add_argument("--refuses", default="")
    args = parser.parse_args()
    signal.signal(signal.SIGTERM, signal.SIG_IGN if args.deaf else lambda *_: sys.exit(args.told))
    out = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    with (args.runtime / "starts").open("a") as file:
        file.write("started\n")
    start = time.monotonic()
    while True:
        late = time.monotonic() - start > 0.5
        if args.after is not None:
            late = (args.runtime / args.after).exists()
        if late and args.code is not None:
            print("error: told to end", file=sys.stderr, flush=True)
            os._exit(args.code)  # as the gate: the interpreter's own end takes time without a beat
        if late and args.crash:
            os.kill(os.getpid(), signal.SIGKILL)
        if not (late and args.hang):
            warnings = ("a parameter is odd",)
            beat = Heartbeat(time.monotonic_ns(), args.state, "", warnings=warnings)
            if args.refuses:
                checks = (Check("frames", False, args.refuses, "check the camera"),)
                beat = replace(beat, t_ns=10 * beat.t_ns, checks=checks)
            out.sendto(to_json(beat), str(args.runtime / "parent.sock"))
        time.sleep(0.02)


if __name__ == "__main__":
    main()
