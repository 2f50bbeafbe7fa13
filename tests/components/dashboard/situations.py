"""Situations in which the dashboard is looked at."""

import dataclasses

from flight_on_screen import Flight

DESKTOP, PHONE, WIDE = (1440, 900), (390, 844), (2560, 1300)
SOURCES = ("state", "vehicle", "battery", "results", "view", "flow", "timing")
GROUNDED = ("IDLE", "ABORT", "RELEASED")


@dataclasses.dataclass(frozen=True)
class Situation:
    """A flight, and the page that shows it.

    ``says`` is visible text. The page of a ``late`` one is opened after everything has happened.
    """

    name: str
    flight: Flight
    size: tuple = DESKTOP
    theme: str = "light"
    says: str = ""
    late: bool = False

    @property
    def may_be_flown(self):
        flight = self.flight
        is_new = flight.is_seen and flight.age("results") < 1 and flight.age("state") < 1
        return is_new and flight.state not in GROUNDED


def silent(flight, age_s, *sources):
    """Flight some sources of which fell silent so long ago; all of them where none are named."""
    return dataclasses.replace(flight, ages=dict.fromkeys(sources or SOURCES, age_s))


def long_over(flight, since_s):
    return dataclasses.replace(flight, since_s=since_s)


IDLE = Flight("IDLE", "waiting for the autopilot")
PREFLIGHT = Flight("PREFLIGHT", "overlap with the goal: 12 %, at least 25 % needed")
READY = Flight("READY", "checks passed")
ENGAGE = Flight("ENGAGE", "pilot switched to OFFBOARD", since_s=1.0)
SERVO = Flight()
HOLD = Flight("HOLD", "operator commanded to hold")
DONE = Flight("DONE", "error in tolerance", fields={"reached": True})
ABORT = Flight("ABORT", "goal lost for 3 s")
RELEASED = Flight("RELEASED", "pilot switched to POSCTL", fields={"mode": "POSCTL"})
BLACK_BOX = "the black box was killed by SIGKILL; no more of this flight is kept"
WARNED = Flight(fields={"warnings": (BLACK_BOX, "COM_OBL_RC_ACT is 0")})
UNKNOWN = Flight(
    "IDLE",
    "waiting",
    since_s=20.0,
    fields={"vehicle": None, "battery": None, "heartbeat_age_s": None, "mode": ""},
    is_seen=False,
)
NO_FRAME = silent(Flight("HOLD", "no frame", since_s=9.0), 9.0, "view", "results", "flow")
NO_FRAME_ABORT = silent(Flight("ABORT", "no frame", since_s=6.0), 9.0, "view", "results", "flow")
NO_RESULTS = silent(SERVO, 5.0, "results", "flow", "timing")
NO_AUTOPILOT = silent(Flight("ABORT", "autopilot silent", since_s=3.0), 5.0, "vehicle", "battery")

SITUATIONS = [
    Situation("idle", IDLE, theme="dark"),
    Situation("preflight", PREFLIGHT),
    Situation("ready", READY, theme="dark"),
    Situation("engage", ENGAGE),
    Situation("servo", SERVO, says="✓ valid"),
    Situation("servo-dark", SERVO, theme="dark"),
    Situation("servo-phone", SERVO, PHONE),
    Situation("servo-phone-dark", SERVO, PHONE, "dark"),
    Situation("servo-wide", SERVO, WIDE),
    Situation("hold", long_over(HOLD, 0.8)),
    Situation("hold-phone", HOLD, PHONE, "dark"),
    Situation("done", DONE, says="DONE: goal reached"),
    Situation("done-phone", DONE, PHONE, "dark"),
    Situation("done-wide", DONE, WIDE, "dark"),
    Situation("abort", ABORT, says="image good, the gate is in ABORT"),
    Situation("abort-phone", ABORT, PHONE),
    Situation("released", RELEASED, theme="dark"),
    Situation("silent-servo", silent(SERVO, 12.0), says="STALE: was SERVO"),
    Situation("silent-servo-phone", silent(SERVO, 12.0), PHONE, "dark", "silent"),
    Situation("silent-done", silent(DONE, 6.0)),
    Situation("silent-abort", silent(ABORT, 4.0), theme="dark"),
    Situation("camera-silent", NO_FRAME, says="NO NEW IMAGE FOR 9.0 s"),
    Situation("camera-silent-phone", NO_FRAME_ABORT, PHONE),
    Situation("perception-silent", NO_RESULTS, theme="dark", says="? result 5.0 s old"),
    Situation("autopilot-silent", NO_AUTOPILOT, says="autopilot heard 5.4 s ago"),
    Situation("battery-silent", silent(SERVO, 30.0, "battery")),
    Situation("flow-silent", silent(SERVO, 4.0, "flow"), theme="dark", says="4.0 s old"),
    Situation(
        "state-silent",
        silent(SERVO, 3.0, "state", "vehicle", "battery"),
        says="? state of the gate not known",
    ),
    Situation("opened-late", SERVO, late=True),
    Situation("opened-late-done-phone", DONE, PHONE, late=True),
    Situation(
        "opened-after-the-end", silent(long_over(ABORT, 26.0), 25.0), says="25.0 s old", late=True
    ),
    Situation("warnings", WARNED, says=BLACK_BOX),
    Situation("nothing-known", UNKNOWN, PHONE, "dark", "autopilot heard never"),
    Situation("no-uncertainty", dataclasses.replace(SERVO, knows_uncertainty=False)),
]
