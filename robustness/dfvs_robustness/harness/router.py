"""``python -m dfvs_robustness.harness.router ENDPOINT``: a Zenoh router, to be killed."""

import signal
import sys

from dfvs_common.lifecycle import end_with_parent
from dfvs_common.zenoh_session import open_session


def main() -> None:
    """Route until killed, or until the process that started this is gone."""
    end_with_parent()
    with open_session("router", (), (sys.argv[1],)):
        print("ready", flush=True)
        signal.pause()


if __name__ == "__main__":
    main()
