"""Opening Zenoh sessions, with errors that a user understands."""

from __future__ import annotations

import zenoh

from dfvs_core.errors import ConfigError
from dfvs_core.wire.zenoh_settings import zenoh_settings
from dfvs_service.config import ZenohSection


def open_session(config: ZenohSection) -> zenoh.Session:
    """Open a session as configured.

    Raises
    ------
    ConfigError
        If the router cannot be reached (client) or an endpoint cannot be listened on (peer).
    """
    settings = zenoh.Config()
    for key, value in zenoh_settings(config.mode, config.connect, config.listen):
        settings.insert_json5(key, value)
    try:
        return zenoh.open(settings)
    except zenoh.ZError as error:
        reason = str(error).split(" at /")[0]
        raise ConfigError(
            f"Zenoh cannot be opened: {reason}",
            "a free listen endpoint, and a running router for mode client",
            "see zenoh.listen and zenoh.connect in the configuration",
        ) from error
