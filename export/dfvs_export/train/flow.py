"""Training of dfvs-flow: draw, disturb, match both ways, step; checkpoint and measure."""

from __future__ import annotations

import csv
import math
import time
from collections.abc import Callable
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from dfvs_core.errors import ConfigError
from dfvs_export.data.photometric import disturb
from dfvs_export.data.shards import Batch
from dfvs_export.data.stream import PairMakers, PairStream
from dfvs_export.networks.architecture import FlowArchitecture
from dfvs_export.networks.dfvs_flow import DfvsFlow, Match
from dfvs_export.train.checkpoint import (
    Checkpoint,
    RunningAverage,
    fill,
    load_checkpoint,
    save_checkpoint,
)
from dfvs_export.train.curve import draw_curve
from dfvs_export.train.loss import Truth, flow_loss
from dfvs_export.train.settings import TrainSettings, describe
from dfvs_export.train.validation import LevelScores, read_validation, score_network

_AVERAGE_DECAY = 0.998
_FIRST_SHARD_WAIT_S = 600.0
_REPORT_STEPS = 20
_WARM_UP = 0.03
_MAKER_SEED_STRIDE = 100_000
_MAX_GRADIENT = 1.0


def learning_rate(peak: float, progress: float, warm_up: float) -> float:
    """Rise to ``peak`` over the share ``warm_up`` of the run, then a cosine down to 1 % of it."""
    if progress < warm_up:
        return peak * (0.05 + 0.95 * progress / warm_up)
    turn = 0.5 * (1.0 + math.cos(math.pi * min(1.0, (progress - warm_up) / (1.0 - warm_up))))
    return peak * (0.01 + 0.99 * turn)


def match_both_ways(network: DfvsFlow, images: Tensor) -> Match:
    """Match pairs (N, 2, 3, H, W) both ways; the result holds 2 N, a to b before b to a."""
    n = len(images)
    flat = images.flatten(0, 1).contiguous(memory_format=torch.channels_last)
    features = network.encode(flat)
    swap = torch.arange(2 * n, device=images.device).reshape(n, 2).flip(1).flatten()
    return network.match(features, features[swap])


def truth_of(batch: Batch) -> Truth:
    """Ground truth in the order of ``match_both_ways``."""
    return Truth(
        batch.flows.flatten(0, 1),
        batch.visible.flatten(0, 1).unsqueeze(1).float(),
        batch.solid.flatten(0, 1).unsqueeze(1).float(),
    )


def _device(name: str) -> torch.device:
    """Return a device that torch can use.

    Raises
    ------
    ConfigError
        If it cannot.
    """
    try:
        return torch.zeros(1, device=name).device
    except (RuntimeError, AssertionError) as error:  # the latter where torch was built without it
        reason = str(error).splitlines()[0]
        raise ConfigError(f"torch cannot use the device {name!r} ({reason})", "cpu") from error


class FlowTraining:
    """One run: the network, its optimiser and where it stands."""

    def __init__(self, settings: TrainSettings, resume: Path | None = None) -> None:
        torch.manual_seed(settings.seed)
        self.settings = settings
        self.validation = read_validation(settings.validation) if settings.validation else None
        checkpoint = load_checkpoint(resume) if resume else None
        architecture = checkpoint.architecture if checkpoint else FlowArchitecture()
        network = DfvsFlow(architecture).to(_device(settings.device))
        self.network = network.to(memory_format=torch.channels_last)  # type: ignore[call-overload]
        self.optimiser = torch.optim.AdamW(
            self.network.parameters(), lr=settings.learning_rate, weight_decay=1e-4
        )
        self.step = 0
        self.warm_up = _WARM_UP
        self.origin: tuple[dict[str, Any], ...] = (describe(settings, architecture),)
        self.notes = checkpoint.notes if checkpoint else ""
        if checkpoint:
            fill(self.network, checkpoint.weights)
            if checkpoint.optimiser:  # shipped weights come without
                self.optimiser.load_state_dict(checkpoint.optimiser)
                self.warm_up = 0.0  # it is warm already
            self.step = checkpoint.step
            self.origin = checkpoint.origin + self.origin
        if settings.keep_norms:
            for module in self.network.modules():
                if isinstance(module, torch.nn.BatchNorm2d):
                    module.eval()
        self.average = RunningAverage(self.network, _AVERAGE_DECAY)
        if checkpoint:
            for name, value in checkpoint.average.items():
                self.average.state[name].copy_(value)

    def train_step(self, batch: Batch, progress: float) -> dict[str, float]:
        """Take one step and return the loss's parts."""
        torch.manual_seed(self.settings.seed * 1_000_003 + self.step)
        for group in self.optimiser.param_groups:
            group["lr"] = learning_rate(self.settings.learning_rate, progress, self.warm_up)
        images = disturb(batch.images.flatten(0, 1)).reshape(batch.images.shape)
        device = torch.device(self.settings.device)
        half = self.settings.precision == "bf16"
        context = torch.autocast(device.type, torch.bfloat16) if half else nullcontext()
        with context:
            match = match_both_ways(self.network, images)
        loss, parts = flow_loss(match, truth_of(batch))
        self.optimiser.zero_grad()
        loss.backward()  # type: ignore[no-untyped-call]
        norm = torch.nn.utils.clip_grad_norm_(self.network.parameters(), _MAX_GRADIENT)
        if torch.isfinite(norm):  # a broken step is left out, not learned
            self.optimiser.step()
            self.average.follow(self.network, self.step)
        self.step += 1
        return parts | {"loss": float(loss.detach())}

    def checkpoint(self) -> Checkpoint:
        """Return everything needed to go on."""
        return Checkpoint(
            self.network.state_dict(),
            self.average.state,
            self.optimiser.state_dict(),
            self.step,
            self.origin,
            self.network.architecture,
            self.notes,
        )

    def averaged_network(self) -> DfvsFlow:
        """Return a copy with the averaged weights, in evaluation mode."""
        network = DfvsFlow(self.network.architecture).to(self.settings.device)
        network.load_state_dict(self.average.state)
        return network.eval()


def train_flow(settings: TrainSettings, resume: Path | None, report: Callable[[str], None]) -> Path:
    """Train and return the path of the last checkpoint.

    Raises
    ------
    ConfigError, ModelError
        If there are no pairs to train on, or the checkpoint to resume cannot be used.
    """
    torch.set_num_threads(settings.threads)
    training = FlowTraining(settings, resume)
    try:
        settings.out.mkdir(parents=True, exist_ok=True)
        settings.pairs_folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ConfigError(f"{error.filename} cannot be made ({error.strerror})") from error
    pairs = settings.pair_settings()
    folder = settings.pairs_folder
    first_seed = (settings.seed + 1) * _MAKER_SEED_STRIDE + training.step
    stream = PairStream(folder, pairs, settings.pairs_per_step, settings.seed, _FIRST_SHARD_WAIT_S)
    makers = PairMakers(folder, pairs, settings.makers, first_seed, settings.keep_shards)
    with makers:
        stream.batch(training.step, check=makers.check)  # waits for the first shard, off the clock
        return _loop(training, stream, report)


def _loop(training: FlowTraining, stream: PairStream, report: Callable[[str], None]) -> Path:
    settings = training.settings
    start, first = time.monotonic(), training.step
    saved_at, sums = start, dict[str, float]()
    while True:
        elapsed = time.monotonic() - start
        done = training.step - first
        progress = done / settings.steps if settings.steps else elapsed / (60 * settings.minutes)
        if progress >= 1.0:
            return _save(training, report)
        batch = stream.batch(training.step, settings.device)
        for name, value in training.train_step(batch, progress).items():
            sums[name] = sums.get(name, 0.0) + value
        if training.step % _REPORT_STEPS == 0:
            left = elapsed * (1.0 / max(progress, 1e-6) - 1.0)
            means = "  ".join(f"{k} {v / _REPORT_STEPS:.2f}" for k, v in sums.items())
            report(f"step {training.step}  {means}  {left / 60:.0f} min left")
            _append(settings.out / "train.csv", {"step": training.step} | sums)
            sums = {}
        if time.monotonic() - saved_at > 60 * settings.checkpoint_minutes:
            _save(training, report)
            saved_at = time.monotonic()


def _save(training: FlowTraining, report: Callable[[str], None]) -> Path:
    """Write a checkpoint, measure it, and draw the curve."""
    out = training.settings.out
    path = out / "last.pt"
    save_checkpoint(path, training.checkpoint())
    if training.validation is not None:
        scores = score_network(training.averaged_network(), training.validation)
        report(f"step {training.step}  " + "  ".join(s.line() for s in scores))
        row: dict[str, float] = {"step": training.step}
        for s in scores:
            row |= {f"{s.level}_epe_px": s.epe_px, f"{s.level}_under_3px": s.under_3px}
        _append(out / "validation.csv", row)
        draw_curve(out / "validation.csv", out / "validation.png")
        _keep_best(training, scores, out)
    return path


def _keep_best(training: FlowTraining, scores: tuple[LevelScores, ...], out: Path) -> None:
    """Copy the checkpoint when its geometric mean of errors is the least so far."""
    value = math.prod(max(s.epe_px, 1e-6) for s in scores) ** (1.0 / len(scores))
    note = out / "best.txt"
    if not note.exists() or value < float(note.read_text().split()[0]):
        save_checkpoint(out / "best.pt", training.checkpoint())
        note.write_text(f"{value:.4f} px at step {training.step}\n")


def _append(path: Path, row: dict[str, float]) -> None:
    """Add a row to a CSV file, with a head line when it is new."""
    new = not path.exists()
    with path.open("a", newline="") as file:
        writer = csv.DictWriter(file, fieldnames=list(row))
        if new:
            writer.writeheader()
        writer.writerow({k: v if k == "step" else f"{v:.4f}" for k, v in row.items()})
