"""``python -m dfvs_robustness.harness.router ENDPOINT``: a Zenoh router, to be killed."""

from __future__ import annotations

import json
import signal
import sys

import zenoh

from dfvs_common.lifecycle import end_with_parent
from dfvs_core.messages.zenoh_settings import zenoh_settings


def main() -> None:
    """Route until killed, or until the process that started this is gone."""
    end_with_parent()
    settings = zenoh.Config()
    for key, value in zenoh_settings("peer", (), (sys.argv[1],)):
        settings.insert_json5(key, value)
    settings.insert_json5("mode", json.dumps("router"))
    with zenoh.open(settings):
        print("ready", flush=True)
        signal.pause()


if __name__ == "__main__":
    main()
