"""PX4's flight modes and how a heartbeat spells them."""

import enum

AUTO = 4
"""Main mode of every mode that flies by itself; the sub mode says which one."""

_CUSTOM, _GUIDED, _STABILIZE, _MANUAL, _ARMED = 1, 8, 16, 64, 128
_AUTO_FLAG = 4


class Mode(enum.Enum):
    """A flight mode; the value is PX4's (main mode, sub mode)."""

    MANUAL = (1, 0)
    ALTITUDE = (2, 0)
    POSITION = (3, 0)
    TAKEOFF = (AUTO, 2)
    HOLD = (AUTO, 3)
    MISSION = (AUTO, 4)
    RETURN = (AUTO, 5)
    LAND = (AUTO, 6)
    OFFBOARD = (6, 0)
    STABILIZED = (7, 0)
    TERMINATION = (10, 0)

    @property
    def prevents_arming(self) -> bool:
        """Whether a vehicle on the ground cannot be armed in it."""
        return self in (Mode.LAND, Mode.RETURN, Mode.MISSION, Mode.TERMINATION)

    @property
    def needs_manual_control(self) -> bool:
        """Whether the mode is flown with sticks."""
        return self in (Mode.MANUAL, Mode.ALTITUDE, Mode.POSITION, Mode.STABILIZED)

    @property
    def custom_mode(self) -> int:
        """Number in HEARTBEAT.custom_mode: ``main << 16 | sub << 24``."""
        main, sub = self.value
        return int(main << 16 | sub << 24)

    def base_mode(self, *, armed: bool) -> int:
        """Flags in HEARTBEAT.base_mode."""
        if self is Mode.OFFBOARD:
            return _CUSTOM | ((_ARMED | _STABILIZE) if armed else 0)
        flags = _CUSTOM | (_ARMED if armed else 0)
        if self.value[0] == AUTO:
            return flags | _AUTO_FLAG | _GUIDED | _STABILIZE
        if self in (Mode.MANUAL, Mode.TERMINATION):
            return flags | _MANUAL
        return flags | _MANUAL | _STABILIZE


def mode_from_numbers(main: int, sub: int) -> Mode | None:
    """Mode of DO_SET_MODE's second and third parameter; None if there is no such mode here.

    POSCTL and the like are named by their main mode alone, whatever the sub mode says.
    """
    for mode in Mode:
        if (
            mode is not Mode.TERMINATION
            and mode.value[0] == main
            and (main != AUTO or mode.value[1] == sub)
        ):
            return mode
    return None


def mode_from_custom(custom_mode: int) -> Mode | None:
    """Mode that a heartbeat's custom_mode spells; None if it is none of ours."""
    return mode_from_numbers(custom_mode >> 16 & 0xFF, custom_mode >> 24 & 0xFF)
