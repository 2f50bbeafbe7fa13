"""The report of a flight: a page and a film, made by ``dfvs-report`` of the flight's recording."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from dfvs_common.child import Child
from dfvs_core.errors import DfvsError
from dfvs_sim.demo.flight.track import Track

PAGE, FILM = "report.html", "flight.webm"
_TIMEOUT_S = 600.0


class ReportError(DfvsError):
    """No report could be made of a flight."""


class FlightReport:
    """Has a flight recorded, and makes its report in the folder: what an earlier flight left goes.

    ``settings`` are those of ``dfvs-service``, which may say where the recording goes.
    """

    def __init__(self, folder: Path, settings: Mapping[str, Any]) -> None:
        self._folder = folder
        records = settings["record"]["folder"]
        self._records = Path(records) if records else folder / "record"
        self.words: tuple[str, ...] = () if records else ("--record", str(self._records))
        """Words that ``dfvs-service`` needs besides."""
        if not records:
            for old in self._records.glob("*.mcap"):
                old.unlink()
        for name in (PAGE, FILM):
            (folder / name).unlink(missing_ok=True)
        self._earlier = frozenset(self._records.glob("*.mcap"))

    def make(self, track: Track) -> tuple[Path, ...]:
        """Make the report; returns the files that it consists of.

        Raises
        ------
        ReportError
            If none can be made.
        """
        files = sorted(set(self._records.glob("*.mcap")) - self._earlier)
        if not files:
            raise ReportError(f"there is no recording in {self._records}")
        truth = self._folder / "truth.jsonl"
        lines = (
            json.dumps({"t_ns": p.t_ns, "error_m": p.error_m, "error_rad": p.error_rad}) + "\n"
            for p in track.points
        )
        truth.write_text("".join(lines), encoding="utf-8")
        page, film = self._folder / PAGE, self._folder / FILM
        words = ["dfvs_service.report.cli", *map(str, files), "--truth", str(truth)]
        words += ["--out", str(page), "--film", str(film)]
        with Child("report", words, self._folder / "report.log") as child:
            code = child.wait(_TIMEOUT_S)
        if code != 0:
            raise ReportError(f"dfvs-report failed: {child.last_lines()}")
        return tuple(path for path in (page, film) if path.exists())
