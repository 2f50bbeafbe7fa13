import os
import signal
import subprocess
import sys
import threading

import psutil
import pytest
from distributed import LocalCluster

from dfvs_bench.trials.executor import TrialExecutor
from dfvs_core.errors import ConfigError


def squared(number):
    if number < 0:
        raise ConfigError(f"{number} is negative", "a positive number")
    return number * number, threading.get_ident()


@pytest.fixture(scope="module")
def cluster():
    with LocalCluster(
        n_workers=1,
        threads_per_worker=1,
        processes=False,
        host="127.0.0.1",
        protocol="tcp://",
        dashboard_address=None,
    ) as cluster:
        yield cluster.scheduler_address


@pytest.mark.parametrize("workers", [1, 2])
def test_every_job_is_done_once_on_this_machine(workers):
    done = TrialExecutor(workers).finished(abs, [3, -1, 2])
    assert sorted(done) == [1, 2, 3]


def test_every_job_is_done_once_on_a_cluster(cluster):
    done = list(TrialExecutor(dask=cluster).finished(squared, [3, 1, 3]))
    assert sorted(value for value, _ in done) == [1, 9, 9]
    assert threading.get_ident() not in {thread for _, thread in done}


def test_the_error_of_a_job_on_a_cluster_keeps_its_words(cluster):
    with pytest.raises(ConfigError, match="-1 is negative; expected a positive number"):
        list(TrialExecutor(dask=cluster).finished(squared, [1, -1]))


def test_jobs_are_not_begun_before_anybody_listens():
    results = TrialExecutor().finished(squared, [-1])
    with pytest.raises(ConfigError):
        next(results)


def test_a_scheduler_that_does_not_answer_is_named():
    import dask

    with (
        dask.config.set({"distributed.comm.timeouts.connect": "0.2s"}),
        pytest.raises(ConfigError, match=r"tcp://127\.0\.0\.1:9: no scheduler"),
    ):
        list(TrialExecutor(dask="tcp://127.0.0.1:9").finished(squared, [1]))


def test_ctrl_c_ends_the_jobs_that_run():
    words = "from dfvs_bench.trials.executor import TrialExecutor\n"
    job = r"import os, time; os.write(1, b'begun\n'); time.sleep(60)"  # one write, not torn apart
    words += f"list(TrialExecutor(2).finished(exec, [{job!r}] * 4))"
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.DEVNULL, "text": True}
    command = [sys.executable, "-c", words]
    with subprocess.Popen(command, start_new_session=True, **pipes) as parent:
        assert [parent.stdout.readline() for _ in range(2)] == ["begun\n"] * 2
        os.killpg(parent.pid, signal.SIGINT)
        assert parent.wait(timeout=30.0) != 0


def test_workers_end_with_a_parent_that_is_killed():
    words = "import os; from dfvs_bench.trials.executor import TrialExecutor\n"
    words += "list(TrialExecutor(2).finished(os.system, ['echo $PPID; sleep 60'] * 2))"
    command = [sys.executable, "-c", words]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, text=True, start_new_session=True
    ) as parent:
        workers = [psutil.Process(int(parent.stdout.readline())) for _ in range(2)]
        parent.kill()
        _, alive = psutil.wait_procs(workers, timeout=30.0)
        os.killpg(parent.pid, signal.SIGKILL)  # the jobs of those that have ended
    assert len(set(workers)) == 2
    assert not alive


@pytest.mark.parametrize(("workers", "dask"), [(0, None), (257, None), (2, "tcp://127.0.0.1:1")])
def test_a_workforce_that_cannot_be_is_refused(workers, dask):
    with pytest.raises(ConfigError, match="--workers"):
        TrialExecutor(workers, dask)
