"""Opening Zenoh sessions."""

import zenoh

from dfvs_core.errors import ConfigError
from dfvs_core.messages.zenoh_settings import Encryption, ZenohMode, zenoh_settings


def open_session(
    mode: ZenohMode,
    connect: tuple[str, ...],
    listen: tuple[str, ...] = (),
    encryption: Encryption | None = None,
) -> zenoh.Session:
    """Open a session with the settings of :func:`zenoh_settings`.

    A peer connects to its endpoints now, or as soon as they are there; a client needs its router.

    Raises
    ------
    ConfigError
        If an endpoint is none or cannot be listened on, or the router cannot be reached.
    """
    settings = zenoh.Config()
    try:
        for key, value in zenoh_settings(mode, connect, listen, encryption):
            settings.insert_json5(key, value)
        return zenoh.open(settings)
    except zenoh.ZError as error:
        raise ConfigError(
            f"Zenoh cannot be opened: {str(error).split(' at /')[0]}",
            "an endpoint such as tcp/127.0.0.1:7447",
        ) from error
