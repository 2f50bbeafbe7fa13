"""The scripted camera: good frames until a script says otherwise."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from dfvs_common.clock import local_clock
from dfvs_core.geometry.arrays import ImageArray
from dfvs_core.messages.frame import Frame, PixelFormat, encode_frame
from dfvs_robustness.harness.wall import Pose, Wall

PERIOD_NS = 66_666_667
"""Of 15 frames a second."""

Packet = tuple[bytes, bytes]
"""Payload and attachment of one sample on the camera's key."""


@dataclass(frozen=True, slots=True)
class CapturedFrame:
    """What a script may make samples of: a good image, its time and number."""

    image: ImageArray
    t_ns: int
    seq: int
    pixel_format: PixelFormat
    clock: bytes

    def packet(self) -> Packet:
        """Encode the frame."""
        frame = Frame(self.image, self.t_ns, self.seq)
        return encode_frame(frame, self.pixel_format, self.clock)

    def showing(self, image: ImageArray) -> CapturedFrame:
        """The same frame with another image (H, W, 3)."""
        return replace(self, image=np.ascontiguousarray(image))


Script = Callable[[CapturedFrame], list[Packet]]


class ScriptedCamera:
    """Takes images of a wall; a script decides which payload and attachment are published of them.

    The format is JPEG, or RGB8 where colours must arrive as they are.
    """

    def __init__(
        self, wall: Wall, pixel_format: PixelFormat, publish: Callable[[bytes, bytes], None]
    ) -> None:
        self.wall = wall
        self.script: Script | None = None
        self.good_ns: list[int] = [0]
        """Captures of all frames that nothing was wrong with."""
        self._format = pixel_format
        self._publish = publish
        self._clock = local_clock()
        self._seq = 0
        self._good_to_come = 0

    def follow(self, script: Script | None, *, first_is_good: bool = False) -> None:
        """Follow a script from the next frame on, or none.

        ``first_is_good`` tells that its first sample shows the truth of its time.
        """
        self._good_to_come = int(first_is_good)
        self.script = script

    @property
    def last_good_ns(self) -> int:
        """Capture of the last good frame."""
        return self.good_ns[-1]

    def capture(self, pose: Pose, t_ns: int) -> None:
        """Take the image of this moment and publish what is to be published of it."""
        captured = CapturedFrame(
            self.wall.capture(pose), t_ns, self._seq, self._format, self._clock
        )
        self._seq += 1
        script = self.script
        packets = [captured.packet()] if script is None else script(captured)
        if script is None or self._good_to_come:
            self.good_ns.append(t_ns)
            self._good_to_come = 0
        for payload, attachment in packets:
            self._publish(payload, attachment)

    def lose_goal(self) -> None:
        """Show a view that shares nothing with the goal, from the next frame on."""
        self.follow(lambda captured: [captured.showing(unrelated_view(captured.image)).packet()])


def unrelated_view(image: ImageArray) -> ImageArray:
    """View (H, W, 3) that shares nothing with the one given."""
    return image[::-1, ::-1] ^ np.uint8(0xA5)
