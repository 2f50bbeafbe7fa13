"""Work on watched threads: started once more after a failure, then given up, and never silently."""

from dfvs_service.supervisor.watched_thread import run_watched, start_watched


def failing(times, calls):
    """Work that fails so often, then is done."""

    def work():
        calls.append(1)
        if len(calls) <= times:
            raise KeyError(f"failure {len(calls)}")

    return work


def run(times):
    calls, lines, ends = [], [], []
    run_watched("watcher", failing(times, calls), lines.append, ends.append)
    return len(calls), lines, ends


def test_work_that_is_done_is_not_repeated_and_nothing_is_said():
    assert run(0) == (1, [], [])


def test_work_that_fails_once_is_started_once_more():
    calls, lines, ends = run(1)
    assert (calls, ends) == (2, [])
    (line,) = lines
    assert "'watcher' failed (KeyError('failure 1'))" in line
    assert "started once more" in line


def test_work_that_fails_twice_is_given_up_and_said_so():
    calls, lines, ends = run(99)
    assert calls == 2
    assert "it has ended" in lines[1]
    assert ends == lines[1:]


def test_a_failure_is_logged_with_its_origin(caplog):
    run(1)
    assert "KeyError: 'failure 1'" in caplog.text


def test_a_thread_runs_its_work_under_the_watch():
    lines = []
    start_watched("watcher", failing(1, []), lines.append).join(30.0)
    assert len(lines) == 1
