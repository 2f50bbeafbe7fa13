"""Hostile frames through the whole decoder: no exception, no memory, no time."""

from __future__ import annotations

import functools
import multiprocessing
import os
import time
from collections import defaultdict
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from dfvs_common.child import end_worker_with_parent
from dfvs_core.perception.frame_validator import Admission, Expected, GuardState, admit
from dfvs_robustness.fuzz.frames.hostile_frames import CAMERA, CLOCK, NOW_NS, Corpus, HostileFrame
from dfvs_robustness.fuzz.random_source import RandomSource

EXPECTED = Expected(CAMERA, CLOCK)
FRAMES_PER_JOB = 500
MOST_FLAWS = 20
_STATUS, _CLEAR = Path("/proc/self/status"), Path("/proc/self/clear_refs")
_KEPT = 512
_WARM_UP_JOBS = 2


@dataclass(slots=True)
class KindTally:
    """What became of the frames of one kind; times in ms of processor time, memory in KiB."""

    count: int = 0
    admitted: int = 0
    times_ms: list[float] = field(default_factory=list)
    """A sample of the times."""
    max_ms: float = 0.0
    max_peak_kib: int = 0

    def see(self, admitted: bool, took_ms: float, peak_kib: int) -> None:
        """Count one frame."""
        self.count += 1
        self.admitted += admitted
        self.max_ms = max(self.max_ms, took_ms)
        self.max_peak_kib = max(self.max_peak_kib, peak_kib)
        if len(self.times_ms) < _KEPT:
            self.times_ms.append(took_ms)

    def add(self, other: KindTally) -> None:
        """Count what another one counted."""
        self.count += other.count
        self.admitted += other.admitted
        self.max_ms = max(self.max_ms, other.max_ms)
        self.max_peak_kib = max(self.max_peak_kib, other.max_peak_kib)
        self.times_ms += other.times_ms[: _KEPT - len(self.times_ms)]


@dataclass(slots=True)
class FrameOutcome:
    """What some frames came to; ``flaws`` are (number, kind, what is wrong)."""

    kinds: defaultdict[str, KindTally] = field(default_factory=lambda: defaultdict(KindTally))
    flaws: list[tuple[int, str, str]] = field(default_factory=list)
    escaped: int = 0
    """Frames that let an exception escape."""
    resident_kib: defaultdict[int, list[int]] = field(default_factory=lambda: defaultdict(list))
    """Memory that each process has filled itself after each of its jobs, without pages of files."""

    def add(self, other: FrameOutcome) -> None:
        """Count what another one counted."""
        for kind, tally in other.kinds.items():
            self.kinds[kind].add(tally)
        self.flaws += other.flaws
        self.escaped += other.escaped
        for pid, sizes in other.resident_kib.items():
            self.resident_kib[pid] += sizes

    @property
    def frames(self) -> int:
        """Number of frames."""
        return sum(tally.count for tally in self.kinds.values()) + self.escaped

    @property
    def growth_kib(self) -> int:
        """Largest growth of a process's memory after its first few jobs.

        Of the least memory in the last third of its jobs over that in the first: what was freed
        last may not have been given back yet.
        """
        settled = [sizes[_WARM_UP_JOBS:] for sizes in self.resident_kib.values()]
        thirds = [(sizes, -(-len(sizes) // 3)) for sizes in settled if sizes]
        return max((min(sizes[-n:]) - min(sizes[:n]) for sizes, n in thirds), default=0)


def hostile_frame(corpus: Corpus, seed: int, number: int) -> HostileFrame:
    """Frame of a number; always the same one for a seed."""
    return corpus.frame(RandomSource(np.random.default_rng((seed, number)), batch=64))


def corpus_of(seed: int) -> Corpus:
    """Good images that the hostile ones are made of."""
    return Corpus(np.random.default_rng(seed))


def _prepare_worker() -> None:
    """Send what libjpeg and libpng print about each broken image to nowhere."""
    end_worker_with_parent()
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 2)
    os.close(nowhere)


def feed(seed: int, numbers: range) -> FrameOutcome:
    """Feed the frames of a seed with these numbers to the decoder, one after the other."""
    outcome, corpus, state = FrameOutcome(), corpus_of(seed), GuardState()
    for number in numbers:
        frame = hostile_frame(corpus, seed, number)
        if number % 8:  # else the memory of the frame before stays, as it does in flight
            state = GuardState()
        resident_kib = reset_peak()
        began_ns = time.thread_time_ns()
        try:
            came = admit(state, frame.payload, frame.attachment, EXPECTED, NOW_NS)
        except Exception as error:  # noqa: BLE001 - to find any exception is what this is for
            outcome.flaws.append((number, frame.kind, f"let {error!r} escape"))
            outcome.escaped += 1
            continue
        took_ms = (time.thread_time_ns() - began_ns) * 1e-6
        peak_kib = memory_kib("VmHWM") - resident_kib
        outcome.kinds[frame.kind].see(came.frame is not None, took_ms, peak_kib)
        must_come = frame.kind == "good" and state == GuardState()
        if flaw := what_is_wrong_with(came, must_come):
            outcome.flaws.append((number, frame.kind, flaw))
        state = came.state
    outcome.resident_kib[os.getpid()].append(memory_kib("RssAnon"))
    return outcome


def what_is_wrong_with(came: Admission, must_come: bool) -> str:
    """Say what a decoder must not give, empty where all is well; a good frame must come through."""
    if came.frame is None:
        if not came.reason or "\n" in came.reason:
            return f"refused without a reason of one line: {came.reason!r}"
        return f"a good frame was refused: {came.reason}" if must_come else ""
    image = came.frame.image
    width, height = CAMERA.size
    if image.shape != (height, width, 3) or image.dtype != np.uint8:
        return f"image of shape {image.shape}, {image.dtype}"
    return ""


def feed_all(
    count: int, workers: int, seed: int, on_progress: Callable[[FrameOutcome], None]
) -> FrameOutcome:
    """Feed so many frames to decoders in processes of their own, which a broken one may end."""
    jobs = [range(n, min(n + FRAMES_PER_JOB, count)) for n in range(0, count, FRAMES_PER_JOB)]
    total, at_once = FrameOutcome(), 2 * workers
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(workers, context, initializer=_prepare_worker) as pool:
        for k in range(0, len(jobs), at_once):
            some = jobs[k : k + at_once]
            try:
                for outcome in pool.map(functools.partial(feed, seed), some):
                    total.add(outcome)
            except BrokenProcessPool:
                total.flaws.append((some[0].start, "one of these jobs", "ended the process"))
                break
            on_progress(total)
            if len(total.flaws) >= MOST_FLAWS:
                break
    return total


def memory_kib(name: str) -> int:
    """Memory of this process by the kernel's own count, 0 where there is no such count."""
    try:
        for line in _STATUS.read_bytes().splitlines():
            if line.startswith(name.encode()):
                return int(line.split()[1])
    except OSError:
        pass
    return 0


def reset_peak() -> int:
    """Let the peak count begin anew; return the present memory in KiB."""
    try:
        _CLEAR.write_bytes(b"5")
    except OSError:
        return memory_kib("VmHWM")
    return memory_kib("VmRSS")
