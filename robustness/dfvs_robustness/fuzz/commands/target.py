"""Episodes of the command ingress: run, checked, counted, shrunk and kept in files."""

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from dfvs_robustness.fuzz.commands.ingress import CommandEpisode, Ingress, Passed, Sending
from dfvs_robustness.fuzz.commands.invariants import CommandChecker
from dfvs_robustness.fuzz.commands.sendings import Sender
from dfvs_robustness.fuzz.finding import Finding, InvariantError
from dfvs_robustness.fuzz.random_source import RandomSource
from dfvs_robustness.fuzz.run import Tally, Target, shrink_list

SENDINGS_PER_EPISODE = 2000


@dataclass(slots=True)
class CommandTally(Tally):
    """Counts of the sendings so far."""

    outcomes: Counter[str] = field(default_factory=Counter)
    """Sendings by kind and what became of them."""

    def see(self, sending: Sending, passed: Passed | None) -> None:
        """Count one sending."""
        self.events += 1
        self.outcomes[f"{sending.kind}: {_became(passed)}"] += 1


class _Trial:
    """An ingress and its checker."""

    def __init__(self, born_ns: int) -> None:
        self._ingress = Ingress(born_ns)
        self._checker = CommandChecker()

    def challenge(self, now_ns: int) -> str:
        challenge = self._ingress.challenge(now_ns)
        self._checker.see_challenge(challenge, now_ns)
        return challenge

    def take(self, sending: Sending, challenge: str) -> Passed | None:
        try:
            passed = self._ingress.take(sending)
        except Exception as error:  # that none leaves it is the invariant
            raise InvariantError("exception", repr(error)) from error
        self._checker.check(sending, challenge, passed, self._ingress)
        return passed


def run_episode(seed: tuple[int, int], tally: CommandTally) -> Finding[CommandEpisode] | None:
    """Run an episode; it is given up to the command that violated an invariant, if one did."""
    rng = RandomSource(np.random.default_rng(seed))
    episode = CommandEpisode(rng.integer(0, 2**50))
    sender, trial = Sender(rng, episode.born_ns), _Trial(episode.born_ns)
    tally.episodes += 1
    try:
        for _ in range(SENDINGS_PER_EPISODE):
            challenge = trial.challenge(sender.next_time())
            sending = sender.next(challenge)
            episode.sendings.append(sending)
            tally.see(sending, trial.take(sending, challenge))
    except InvariantError as violation:
        return Finding(episode, violation.rule, violation.text)
    return None


def replay_episode(episode: CommandEpisode) -> InvariantError | None:
    """Send an episode to a new ingress; return the first violation."""
    trial = _Trial(episode.born_ns)
    for sending in episode.sendings:
        try:
            trial.take(sending, trial.challenge(sending.t_ns))
        except InvariantError as violation:
            return violation
    return None


def shorten(episode: CommandEpisode, fails: Callable[[CommandEpisode], bool]) -> CommandEpisode:
    """Return an episode with as few commands as still fail."""
    few = shrink_list(episode.sendings, lambda some: fails(replace(episode, sendings=some)))
    return replace(episode, sendings=few)


def _became(passed: Passed | None) -> str:
    if passed is None:
        return "dropped"
    if passed.answer.action is not None:
        return "obeyed"
    return "answered again" if passed.answer.is_repeated else "rejected"


def _dump(episode: CommandEpisode) -> dict[str, Any]:
    """What JSON can hold of an episode; bytes are hexadecimal."""
    sendings = [
        [s.t_ns, s.command.hex(), None if s.goal is None else s.goal.hex(), s.kind]
        for s in episode.sendings
    ]
    return {"born_ns": episode.born_ns, "sendings": sendings}


def _episode(document: dict[str, Any]) -> CommandEpisode:
    sendings = [
        Sending(
            int(t_ns),
            bytes.fromhex(command),
            None if goal is None else bytes.fromhex(goal),
            str(kind),
        )
        for t_ns, command, goal, kind in document["sendings"]
    ]
    return CommandEpisode(int(document["born_ns"]), sendings)


_FILES = ("dfvs-command-replay/1", _dump, _episode)
COMMANDS = Target(CommandTally, run_episode, replay_episode, shorten, *_FILES)
