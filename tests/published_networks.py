"""Published networks, one after the other: converted, compared with torch, run in perception.

``make published`` runs this in an environment of its own. Weights are random, so that nothing is
downloaded and no flow is right; what is shown is the path, the agreement, and that the service's
perception answers every frame with a report: a velocity, or why there is none.
"""

import argparse
import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from dfvs_core.geometry.camera import CameraModel
from dfvs_core.messages.frame import Frame, PixelFormat, encode_frame
from dfvs_core.messages.goal import Goal, GoalSidecar
from dfvs_core.messages.link import GateStatus, PerceptionReport, VehicleState
from dfvs_models.catalog import load_matcher
from dfvs_service.frames import RawSample
from dfvs_service.perception.assembly import Clocks, build_frame_processor
from dfvs_service.perception.frame_processor import FrameProcessor
from dfvs_service.settings.config import load_config

NETWORKS = (
    "rapidflow_it3",
    "fastflownet",
    "neuflow2",
    "sea_raft_s",
    "raft_small",
    "pwcnet",
    "flownet2",
)
CAMERA = CameraModel.from_horizontal_fov(320, 240, 1.3)
CLOCK = b"p" * 16
FRAMES = 3
CONVERSION_TIMEOUT_S = 900.0


def convert(name: str, folder: Path) -> dict[str, Any]:
    """Convert a network in a process of its own, which gives its memory back."""
    script = Path(__file__).with_name("published_conversion.py")
    command = [sys.executable, "-W", "ignore", str(script), str(folder), name]
    done = subprocess.run(
        command, capture_output=True, text=True, timeout=CONVERSION_TIMEOUT_S, check=False
    )
    lines = [line for line in done.stdout.splitlines() if line.startswith("{")]
    if done.returncode or not lines:
        raise RuntimeError(f"{name} was not converted: {done.stderr.strip().splitlines()[-1:]}")
    return json.loads(lines[-1])


def perceive(bundle: Path, pictures: list[np.ndarray]) -> tuple[list[PerceptionReport], float]:
    """Show perception a goal, the last picture, and the others; reports, and ms for a frame."""
    sidecar = GoalSidecar(CAMERA)
    overrides = {"flow.model": str(bundle)}
    config, _ = load_config(None, overrides).with_camera((CAMERA.width, CAMERA.height), sidecar)
    matcher = load_matcher(config.flow.model, config.flow.threads, config.flow.provider)
    clocks = Clocks(CLOCK, time.monotonic_ns, time.monotonic_ns)
    eye = build_frame_processor(config, Goal(pictures[-1], sidecar), matcher, clocks)
    reports, times_ms = [], []
    for seq, picture in enumerate(pictures[:-1], 1):
        sample = _sample(eye, picture, seq)
        start = time.perf_counter()
        reports.append(eye.process(sample).report)
        times_ms.append(1e3 * (time.perf_counter() - start))
    return reports, float(np.median(times_ms))


def _sample(eye: FrameProcessor, picture: np.ndarray, seq: int) -> RawSample:
    """Take a frame now, with vehicle states around it."""
    now_ns = time.monotonic_ns()
    for back_ns in (60_000_000, 30_000_000, 0):
        state = VehicleState(now_ns - back_ns, 0.0, 0.0, 0.0, (0.0,) * 3, (0.0,) * 3)
        eye.on_gate_status(GateStatus("SERVO", "", state))
    frame = Frame(picture, now_ns - 5_000_000, seq)
    payload, attachment = encode_frame(frame, PixelFormat.RGB8, CLOCK)
    return RawSample(payload, attachment, now_ns)


def main() -> int:
    """Print a row for each network; 1 where one does not agree with torch or is not run."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("networks", nargs="*", default=NETWORKS, help="names that ptlflow knows")
    names = parser.parse_args().networks
    rng = np.random.default_rng(0)
    goal = rng.integers(0, 256, (CAMERA.height, CAMERA.width, 3), dtype=np.uint8)
    pictures = [np.roll(goal, 4 * k, axis=1) for k in range(FRAMES, -1, -1)]
    holds = True
    print(f"{'network':14} {'torch, px':>10} {'reports':>8} {'ms a frame':>11}  says")
    with tempfile.TemporaryDirectory() as folder:
        for name in names:
            found = convert(name, Path(folder))
            reports, median_ms = perceive(Path(folder) / name, pictures)
            last = reports[-1]
            says = f"velocity {last.velocity}" if last.healthy else last.reason
            difference = found["greatest_px"]
            answered = sum(report.t_capture_ns > 0 for report in reports)
            print(
                f"{name:14} {difference:10.1e} {answered:5d}/{FRAMES:d} {median_ms:11.0f}  {says}",
                flush=True,
            )
            holds &= difference <= 1e-3 and answered == FRAMES
            # zeros would agree with torch too
            holds &= found["finite"] and found["shape"] == [128, 128, 2]
            holds &= found["greatest_flow_px"] > 1.0
    return 0 if holds else 1


if __name__ == "__main__":
    sys.exit(main())
