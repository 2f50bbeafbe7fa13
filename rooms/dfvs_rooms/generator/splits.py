"""Seeds of rooms to train on, to choose on, and to report on; no seed serves two of these."""

from dfvs_core.errors import ConfigError

BENCHMARK_SEEDS = range(4000, 4200)
"""Rooms of the benchmark's scenes, to report on."""
SPLITS = {
    "training": range(30_000, 40_000),
    "choosing": range(8000, 9000),
    "reporting": range(9000, 10_000),
}
"""Thresholds are chosen on the second, and never on the third."""


def require_training(first: int, last: int) -> None:
    """Refuse seeds to train on that are kept for something else."""
    seeds = SPLITS["training"]
    if first not in seeds or last not in seeds:
        raise ConfigError(
            f"rooms {first} to {last} to train on", f"seeds from {seeds[0]} to {seeds[-1]}"
        )
