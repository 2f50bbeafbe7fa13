"""Live Foxglove server with the channels of a recording."""

from collections.abc import Iterable

import foxglove
from foxglove.websocket import WebSocketServer

from dfvs_core.errors import ConfigError
from dfvs_service.record.messages.channels import Channel, Message

LOOPBACK = "127.0.0.1"


class FoxgloveServer:
    """Serves messages to whoever connects on this machine.

    Foxglove calls the connection by ``name``; with ``port`` 0 the system chooses one.

    Raises
    ------
    ConfigError
        If the port is taken.
    """

    def __init__(self, name: str, port: int) -> None:
        self._context = foxglove.Context()
        self._channels: dict[Channel, foxglove.Channel] = {}
        try:
            self._server: WebSocketServer = foxglove.start_server(
                name=name, host=LOOPBACK, port=port, context=self._context
            )
        except (OSError, RuntimeError) as error:
            raise ConfigError(
                f"cannot serve on {LOOPBACK}:{port} ({error})", "a free port", "try --port"
            ) from error
        self.port = self._server.port
        """Port that is served on."""

    def show(self, messages: Iterable[Message]) -> None:
        """Pass messages on; where nobody has asked for their channel they cost nothing more."""
        for message in messages:
            self._channel(message.channel).log(message.data, log_time=message.t_unix_ns)

    def close(self) -> None:
        """Stop serving."""
        self._server.stop()

    def _channel(self, channel: Channel) -> foxglove.Channel:
        if channel not in self._channels:
            schema = None
            if channel.schema_name:
                schema = foxglove.Schema(
                    name=channel.schema_name, encoding=channel.schema_encoding, data=channel.schema
                )
            self._channels[channel] = foxglove.Channel(
                channel.topic,
                schema=schema,
                message_encoding=channel.encoding,
                context=self._context,
            )
        return self._channels[channel]
