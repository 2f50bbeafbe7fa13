"""The command ingress under hostile sendings, and a checker that notices one that is broken."""

import json

import pytest
from subcommand import run_subcommand

from dfvs_core.gate.commands import authority
from dfvs_core.gate.commands.admission import CommandAdmission
from dfvs_core.gate.commands.authority import Authority
from dfvs_core.messages.rate_limit import RateLimit
from dfvs_robustness.commands import fuzz
from dfvs_robustness.fuzz.commands.target import (
    COMMANDS,
    CommandTally,
    replay_episode,
    run_episode,
)


def run(*words):
    return run_subcommand(fuzz, "commands", *words)


def test_hostile_commands_violate_nothing_and_good_ones_are_obeyed(tmp_path):
    path = tmp_path / "figures.json"
    assert run("--events", 30_000, "--seed", 7, "--json", path) == 0
    figures = json.loads(path.read_text())
    assert figures["events"] >= 30_000
    outcomes = figures["outcomes"]
    for became in ("fresh: obeyed", "goal: obeyed", "late: obeyed", "repeated: answered again"):
        assert outcomes[became] > 100
    for kind in ("other key", "other vehicle", "unsigned", "relabelled", "mangled", "truncated"):
        assert outcomes[f"{kind}: rejected"] > 100
        assert f"{kind}: obeyed" not in outcomes


# --- a broken ingress is noticed ----------------------------------------------------------


def forever(value):
    return lambda *args, **kwargs: value


def misses(words):
    """Objections but this one."""
    return lambda old: lambda *args: "" if words in (reason := old(*args)) else reason


def never_repeats(old):
    def judge(self, data, now_ns):
        self._answers.clear()
        return old(self, data, now_ns)

    return judge


def believes_any_challenge(old):
    def objection(self, key, signed):
        self._previous = signed.command.challenge
        return old(self, key, signed)

    return objection


def admits_any_goal(old):
    return lambda self, goal, command, now_ns: (
        "",
        CommandAdmission.admit_command(self, command, now_ns),
    )


def remembers_every_answer(old):
    def record(self, request, answer):
        self._answers[request] = answer

    return record


def fails_on_rubbish(old):
    def admit(self, payload, now_ns):
        payload.decode()
        return old(self, payload, now_ns)

    return admit


def hoards(old):
    def admits(self, now_ns):
        self.hoard = [*getattr(self, "hoard", []), now_ns]
        return old(self, now_ns)

    return admits


BROKEN = [
    ("authentic", authority.hmac, "compare_digest", lambda old: forever(True)),
    ("authentic", Authority, "_objection", misses("vehicle")),
    ("authentic", CommandAdmission, "admit_goal", admits_any_goal),
    ("fresh", Authority, "_objection", believes_any_challenge),
    ("fresh", Authority, "_use_up", lambda old: forever(None)),
    ("fresh", Authority, "_rotate", lambda old: forever(None)),
    ("answer", Authority, "evaluate", never_repeats),
    ("answer", Authority, "record", lambda old: forever(None)),
    ("answer", Authority, "record", remembers_every_answer),
    ("answer", authority, "request_id", lambda old: lambda data: old(data[:40])),
    ("obeyed", Authority, "_objection", lambda old: forever("no")),
    ("rate", RateLimit, "admits", lambda old: forever(True)),
    ("exception", CommandAdmission, "admit_command", fails_on_rubbish),
    ("memory", RateLimit, "admits", hoards),
]


@pytest.mark.parametrize(("rule", "owner", "name", "breaking"), BROKEN)
def test_a_broken_ingress_is_found_out(rule, owner, name, breaking, monkeypatch):
    monkeypatch.setattr(owner, name, breaking(getattr(owner, name)))
    findings = (run_episode((0, number), CommandTally()) for number in range(5))
    finding = next(finding for finding in findings if finding is not None)
    assert finding.rule == rule


# --- violations are kept ------------------------------------------------------------------


def test_a_violation_is_shrunk_and_saved_and_violated_until_the_ingress_is_mended(
    tmp_path, capsys, monkeypatch
):
    monkeypatch.setattr(Authority, "_use_up", forever(None))
    finding = COMMANDS.shrink(run_episode((0, 0), CommandTally()))
    assert len(finding.episode.sendings) == 2  # two commands with one challenge
    path = tmp_path / "finding.json"
    COMMANDS.write(finding, path)
    assert COMMANDS.read(path) == finding.episode
    assert run("--replay", path) == 1
    assert "violated: fresh" in capsys.readouterr().out
    monkeypatch.undo()
    assert replay_episode(finding.episode) is None
    assert run("--replay", path) == 0
