from dfvs_core.gate.config import MS
from dfvs_service.supervisor.heartbeat import HEARTBEAT_LIMIT_NS, STARTUP_LIMIT_NS, HangDetector

START_NS = 77_000 * MS
LOOK_NS = 20 * MS


def overdue_after(watch, start_ns, limit_ns):
    """Look every 20 ms; how long after the start the process counts as hung."""
    now_ns = start_ns
    while now_ns - start_ns <= limit_ns:
        now_ns += LOOK_NS
        if watch.is_overdue(now_ns):
            return now_ns - start_ns
    return None


def test_a_process_that_falls_silent_is_overdue_after_300_ms():
    watch = HangDetector(START_NS)
    watch.is_overdue(START_NS + LOOK_NS)
    watch.on_heartbeat(START_NS + LOOK_NS)
    silence_ns = overdue_after(watch, START_NS + LOOK_NS, 1000 * MS)
    assert HEARTBEAT_LIMIT_NS < silence_ns <= HEARTBEAT_LIMIT_NS + LOOK_NS


def test_a_process_that_beats_is_never_overdue():
    watch, now_ns = HangDetector(START_NS), START_NS
    for _ in range(1000):
        now_ns += LOOK_NS
        watch.on_heartbeat(now_ns)
        assert not watch.is_overdue(now_ns)


def test_slow_imports_are_no_hang_but_an_endless_start_is():
    watch = HangDetector(START_NS)
    silence_ns = overdue_after(watch, START_NS, 100_000 * MS)
    assert STARTUP_LIMIT_NS < silence_ns <= STARTUP_LIMIT_NS + LOOK_NS


def test_a_watcher_that_was_away_itself_blames_nobody_for_that_time():
    watch = HangDetector(START_NS)
    watch.on_heartbeat(START_NS)
    back_ns = START_NS + 5000 * MS
    assert not watch.is_overdue(back_ns)
    silence_ns = overdue_after(watch, back_ns, 1000 * MS)
    assert silence_ns is not None
    assert silence_ns <= HEARTBEAT_LIMIT_NS + LOOK_NS


def test_a_watcher_that_is_late_at_every_look_still_finds_a_hang():
    watch = HangDetector(START_NS)
    watch.on_heartbeat(START_NS)
    looks_ns = (START_NS + i * 110 * MS for i in range(1, 600))
    found_ns = next(now_ns for now_ns in looks_ns if watch.is_overdue(now_ns))
    assert found_ns - START_NS < 2000 * MS


def test_a_watcher_that_is_late_at_every_look_blames_no_process_that_beats():
    watch = HangDetector(START_NS)
    for i in range(1, 100):
        now_ns = START_NS + i * 290 * MS
        watch.on_heartbeat(now_ns)
        assert not watch.is_overdue(now_ns)
