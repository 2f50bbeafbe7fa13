"""Selection of a flight's reader: black box or MCAP recording."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from dfvs_core.errors import ConfigError
from dfvs_service.flights import layout
from dfvs_service.flights.store import parts_of
from dfvs_service.record.preparation import require_record_extra

if TYPE_CHECKING:
    from dfvs_service.report.flight import FlightSource

MCAP = ".mcap"
"""Suffix of a recording's files."""

_LOGS = (layout.HEADER, layout.GATE_INPUTS, layout.GATE_LOG, layout.SERVICE_LOG)
"""Files by which the folder of a flight is known where its name was changed."""


def open_flight(*paths: str | Path) -> FlightSource:
    """Open the records of one flight.

    Parameters
    ----------
    *paths : str or Path
        Folder of a black box, or all files (MCAP) of one recording.

    Returns
    -------
    FlightSource
        ``read()`` gives the :class:`Flight`: summary, curves, settings and goals. ``views()`` goes
        through what the camera saw, oldest first: with flow in a recording, for which perception
        runs again on every frame; one small image a second in a black box.

    Raises
    ------
    ConfigError
        If there is no such flight, or a library that reads recordings is not installed.

    Examples
    --------
    >>> open_flight("no-such-flight")  # doctest: +ELLIPSIS
    Traceback (most recent call last):
    ...
    dfvs_core.errors.ConfigError: there is no folder no-such-flight; expected the folder ...
    """
    files = [Path(path) for path in paths]
    if files and all(path.suffix == MCAP for path in files):
        require_record_extra()
        # ONNX Runtime, MCAP and protobuf take their time to load.
        from dfvs_service.report.recording import RecordedFlight

        return RecordedFlight(files)
    if len(files) != 1:
        named = " ".join(str(path) for path in files)
        raise ConfigError(f"{len(files)} flights: {named}", "one, or files of a recording")
    folder = files[0].resolve()
    if not folder.is_dir():
        raise ConfigError(f"there is no folder {paths[0]}", "the folder of a flight")
    is_named, _ = parts_of(folder.name)
    if not is_named and not any((folder / name).is_file() for name in _LOGS):
        raise ConfigError(f"{paths[0]} holds no flight", "the folder of a flight, or MCAP files")
    from dfvs_service.report.black_box import BlackBoxFlight

    return BlackBoxFlight(folder)
