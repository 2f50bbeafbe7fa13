"""Progress of a recording, in one line."""

from dfvs_service.record.recorder import Recorder


def progress_text(recorder: Recorder) -> str:
    """What was recorded so far, and where."""
    counts, path = recorder.counts, recorder.path
    where = "waiting for a flight" if path is None else path.name
    lost = counts.missing + counts.dropped
    size_mb = recorder.size_bytes / 1e6
    return f"{counts.records} frame records, {size_mb:.1f} MB, {lost} lost  {where}"
