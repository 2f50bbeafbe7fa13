"""What the demo's report is made of: the recording of this flight alone."""

from types import SimpleNamespace

import pytest

from dfvs_sim.demo.results.report import FlightReport, ReportError

TRACK = SimpleNamespace(points=[])


def recorded_to(folder):
    """Settings of a service that is told to record there, or nowhere."""
    return {"record": {"folder": folder}}


def test_what_an_earlier_flight_left_goes_before_the_next_one(tmp_path):
    (tmp_path / "record").mkdir()
    old = [
        tmp_path / "record" / "demo-000.mcap",
        tmp_path / "report.html",
        tmp_path / "flight.webm",
    ]
    for path in old:
        path.write_bytes(b"old")
    report = FlightReport(tmp_path, recorded_to(""))
    assert report.words == ("--record", str(tmp_path / "record"))
    assert not any(path.exists() for path in old)


def test_a_folder_of_recordings_that_was_named_keeps_what_is_in_it(tmp_path):
    old = tmp_path / "mine" / "demo-000.mcap"
    old.parent.mkdir()
    old.write_bytes(b"old")
    report = FlightReport(tmp_path, recorded_to(str(old.parent)))
    assert report.words == ()
    assert old.exists()
    with pytest.raises(ReportError, match="no recording"):
        report.make(TRACK)


def test_a_report_that_fails_says_why(tmp_path):
    report = FlightReport(tmp_path, recorded_to(""))
    (tmp_path / "record").mkdir()
    (tmp_path / "record" / "demo-000.mcap").write_bytes(b"not a recording")
    with pytest.raises(ReportError, match="is not a recording"):
        report.make(TRACK)
