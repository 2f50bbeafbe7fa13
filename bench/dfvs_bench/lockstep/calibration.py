"""Plot of the distance estimate's error against its stated uncertainty."""

from collections.abc import Sequence
from pathlib import Path
from statistics import NormalDist

import matplotlib.pyplot as plt
import numpy as np

from dfvs_bench.lockstep.record import DISTANCE_FROM_M, SimulatedFlight


def plot_calibration(flights: Sequence[SimulatedFlight], path: Path) -> None:
    """Draw the share of errors within k stated standard deviations, and errors over spreads."""
    errors = np.array([e for f in flights for e in f.distance_error])
    spreads = np.array([s for f in flights for s in f.distance_spread])
    figure, (left, right) = plt.subplots(1, 2, figsize=(10.0, 4.0), layout="constrained")
    left.plot(100.0 * spreads, 100.0 * np.abs(np.exp(errors) - 1.0), ".", ms=2, alpha=0.3)
    most = 100.0 * float(max(np.quantile(spreads, 0.99), 0.05)) if len(spreads) else 5.0
    left.plot([0.0, most], [0.0, most], "k-", lw=1, label="one standard deviation")
    left.plot([0.0, most], [0.0, 2.0 * most], "k--", lw=1, label="two")
    left.set(xlabel="stated uncertainty, %", xlim=(0, most), ylim=(0, 3.0 * most))
    left.set_ylabel(f"error of the distance after {DISTANCE_FROM_M:g} m of path, %")
    left.legend(frameon=False)
    k = np.linspace(0.0, 3.0, 61)
    shares = [float(np.mean(np.abs(errors) <= x * spreads)) if len(errors) else 0.0 for x in k]
    right.plot(k, [2.0 * NormalDist().cdf(x) - 1.0 for x in k], "k--", lw=1, label="normal")
    right.plot(k, shares, label="flights")
    right.set(xlabel="stated standard deviations", ylabel="share of errors within", ylim=(0, 1))
    right.legend(frameon=False)
    figure.savefig(path, dpi=120)
    plt.close(figure)
