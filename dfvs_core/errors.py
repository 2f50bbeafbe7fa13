"""Error classes with problem, expected value and remedy."""


class DfvsError(Exception):
    """Base of all errors that a user can correct.

    Parameters
    ----------
    problem : str
        What is wrong, with the offending value in it.
    expected : str
        What would have been right.
    remedy : str
        What the user can do about it.
    """

    def __init__(self, problem: str, expected: str = "", remedy: str = "") -> None:
        self.problem = problem
        self.expected = expected
        self.remedy = remedy
        parts = [problem]
        if expected:
            parts.append(f"expected {expected}")
        if remedy:
            parts.append(remedy)
        super().__init__("; ".join(parts))


class GeometryError(DfvsError):
    """A pose, rotation or camera model that cannot be."""


class ConfigError(DfvsError):
    """A configuration value that cannot be used."""


class WireError(DfvsError):
    """Bytes from outside that do not follow our wire format."""


class ImageError(DfvsError):
    """An image that cannot be read, or has the wrong size or type."""


class ModelError(DfvsError):
    """A model bundle that is damaged or does not match its manifest."""
