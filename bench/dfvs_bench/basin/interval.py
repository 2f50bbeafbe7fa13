"""How sure a share of successes is."""

import math
from dataclasses import dataclass

_Z_95 = 1.959963984540054
"""Two-sided 95 % of the normal distribution."""


@dataclass(frozen=True, slots=True)
class Share:
    """A share of successes with its 95 % confidence interval.

    Parameters
    ----------
    successes, trials : int
        Counts; 0 <= successes <= trials.
    """

    successes: int
    trials: int

    @property
    def ratio(self) -> float:
        """Share of successes; NaN without trials."""
        return self.successes / self.trials if self.trials else math.nan

    @property
    def interval(self) -> tuple[float, float]:
        """Wilson's score interval (J. Am. Stat. Assoc. 22, 1927); (0, 1) without trials.

        Unlike the textbook's interval it stays within 0 and 1, and keeps its width where every
        trial succeeded.
        """
        if not self.trials:
            return 0.0, 1.0
        n, p, z2 = self.trials, self.ratio, _Z_95**2
        middle = (p + z2 / (2 * n)) / (1 + z2 / n)
        half = _Z_95 * math.sqrt(p * (1 - p) / n + z2 / (4 * n * n)) / (1 + z2 / n)
        return max(0.0, middle - half), min(1.0, middle + half)
