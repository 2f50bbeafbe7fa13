"""A ground station's link to a vehicle that answers at once, for tests of the pilot."""

from collections.abc import Callable
from typing import Any


class FakeGroundLink:
    """Messages come from :meth:`message`, which says what the vehicle sends by its name."""

    target = 1

    def __init__(self) -> None:
        self.texts: list[tuple[int, str]] = []

    def message(self, name: str) -> Any:
        """The newest message of that name, None where the vehicle sends none."""
        raise NotImplementedError

    def latest(self, name: str) -> Any:
        return self.message(name)

    def wait_for(
        self,
        name: str,
        _timeout_s: float,
        accept: Callable[[Any], bool] = lambda _: True,
        _since_ns: int = 0,
        **_options: int,
    ) -> Any:
        message = self.message(name)
        return message if message is not None and accept(message) else None
