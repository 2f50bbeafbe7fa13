"""The report of a flight: a page and a film, made by ``dfvs-report`` of the flight's recording."""

import json
from pathlib import Path

from dfvs_common.child import Child
from dfvs_core.errors import DfvsError
from dfvs_sim.demo.flight.engagement import option_values
from dfvs_sim.demo.flight.track import Track

PAGE, FILM = "report.html", "flight.webm"
_OPTION = "--record"
_TIMEOUT_S = 600.0


class ReportError(DfvsError):
    """No report could be made of a flight."""


class FlightReport:
    """Has a flight recorded, and makes its report in the folder: what an earlier flight left goes.

    The words for ``dfvs-service`` may say where the recording goes.
    """

    def __init__(self, folder: Path, service: tuple[str, ...]) -> None:
        self._folder = folder
        given = list(option_values(service, _OPTION))
        self._records = Path(given[-1]) if given else folder / "record"
        self.words: tuple[str, ...] = () if given else (_OPTION, str(self._records))
        """Words that ``dfvs-service`` needs besides."""
        if not given:
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
