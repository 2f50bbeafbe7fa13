import json

import pytest

from dfvs_core.errors import DfvsError
from dfvs_core.gate.checks.preflight import Check
from dfvs_core.gate.config import Engage
from dfvs_service.preflight.check import Observer, watching
from dfvs_service.preflight.report import CheckReport
from dfvs_service.settings.config import load_config
from dfvs_service.supervisor.heartbeat import Heartbeat

LIST = (Check("link", False, "none heard yet", "check it"),)


def test_watching_never_engages_records_or_gives_up():
    config = watching(load_config(None, {"gate.engage": "auto", "record.folder": "flights"}))
    assert config.gate.engage is Engage.NEVER
    assert config.record.folder == ""
    assert min(config.vehicle.timeout_s, config.camera.timeout_s) >= 600


def observer(timeout_s=10.0):
    now = [0.0]
    ends = []
    watch = Observer(timeout_s, lambda: now[0])
    watch.end = lambda: ends.append(now[0])
    return watch, now, ends


def test_it_ends_as_soon_as_all_checks_have_passed():
    watch, _, ends = observer()
    watch.show(Heartbeat(0, "PREFLIGHT", "", checks=LIST))
    assert not ends
    passed = (Check("link", True),)
    watch.show(Heartbeat(0, "READY", "", checks=passed))
    assert watch.is_done
    assert watch.checks == passed
    watch.show(Heartbeat(0, "ABORT", ""))
    assert watch.checks == passed
    assert ends == [0.0]


def test_it_ends_with_the_crosses_there_are_when_the_time_is_up():
    watch, now, ends = observer(10.0)
    now[0] = 9.9
    watch.show(Heartbeat(0, "PREFLIGHT", "", checks=LIST))
    assert not ends
    now[0] = 10.0
    watch.show(Heartbeat(0, "PREFLIGHT", "", checks=LIST))
    assert watch.is_done
    assert watch.checks == LIST
    assert watch.results() == LIST


def test_a_gate_that_has_not_answered_when_the_time_is_up_is_a_cross_with_a_remedy():
    watch, now, _ = observer(3.0)
    now[0] = 3.0
    watch.show(Heartbeat(0, "IDLE", "starting"))
    (check,) = watch.results()
    assert (check.name, check.ok) == ("gate", False)
    assert check.detail == "not answered within 3 s"
    assert "--check-timeout" in check.remedy
    report = CheckReport("swift", (Check("camera", True), check))
    assert not report.ok
    assert [c["status"] for c in json.loads(report.to_json())["checks"]] == ["pass", "failure"]


def test_a_process_that_cannot_run_ends_the_check_with_its_error():
    watch, now, _ = observer(3.0)
    watch.log("warning: slow")
    watch.log("error: port 14540 is taken")
    with pytest.raises(DfvsError, match="port 14540 is taken"):
        watch.results()
    now[0] = 3.0
    watch.show(Heartbeat(0, "IDLE", "starting"))
    with pytest.raises(DfvsError, match="port 14540 is taken"):
        watch.results()


def test_a_process_that_crashed_is_a_cross_beside_the_checks_made_so_far():
    watch, _, _ = observer()
    watch.show(Heartbeat(0, "PREFLIGHT", "", checks=LIST))
    watch.log("error: the gate was killed by SIGKILL")
    *made, crash = watch.results("the gate was killed by SIGKILL")
    assert tuple(made) == LIST
    assert (crash.name, crash.ok) == ("service", False)
    assert crash.detail == "the gate was killed by SIGKILL"
    assert "--runtime-dir" in crash.remedy


def test_a_check_that_is_interrupted_has_no_result():
    watch, _, _ = observer()
    with pytest.raises(DfvsError, match="ended before"):
        watch.results()
