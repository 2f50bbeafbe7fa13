"""The flights in the report's page."""

from collections.abc import Sequence

from dfvs_bench.drone.records import FlightRecord
from dfvs_bench.drone.tables import summarise, summary_line
from dfvs_bench.report.page import render


def drone_section(records: Sequence[FlightRecord]) -> str:
    """HTML of the section, with its heading."""
    summary = summary_line(summarise(records))
    return render("drone.html.j2", records=records, limits=records[0].limits, summary=summary)
