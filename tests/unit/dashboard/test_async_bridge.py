import asyncio

import numpy as np
import pytest

from dfvs_core.messages.frame import Frame, PixelFormat, encode_frame
from dfvs_service.dashboard.async_bridge import AsyncBridge
from dfvs_service.dashboard.hub import Hub
from dfvs_service.dashboard.vehicles.clock import Moment
from dfvs_service.dashboard.vehicles.sample import Arrival


def run(*rounds):
    """Samples that arrive on the loop, for rounds of arrivals one after the other."""

    async def main():
        batches = asyncio.Queue()
        bridge = AsyncBridge(asyncio.get_running_loop(), batches.put_nowait)
        samples = []
        try:
            for arrivals in rounds:
                for arrival in arrivals:
                    bridge.deliver(arrival)
                samples += await asyncio.wait_for(batches.get(), 5.0)
        finally:
            bridge.close()
        return samples

    return asyncio.run(main())


def test_an_arrival_that_raises_any_error_costs_itself_alone():
    bad, good = Arrival("a", "state", None, b""), Arrival("a", "state", b"{}", b"")
    assert [sample.content for sample in run([bad], [good])] == [{}]


def camera_frame(seq):
    image = Frame(np.zeros((8, 8, 3), np.uint8), seq, seq)
    return Arrival("a", "camera", *encode_frame(image, PixelFormat.JPEG))


@pytest.mark.parametrize(("numbers", "missing"), [((1, 2, 3, 4), 0), ((1, 2, 6, 7), 3)])
def test_frames_that_the_dashboard_itself_replaces_are_not_lost_on_the_link(numbers, missing):
    hub = Hub(lambda: Moment(0, 0.0), lambda _: None)

    async def main():
        newest = asyncio.Queue()

        def on_samples(samples):
            hub.on_samples(samples)
            newest.put_nowait(samples[-1].content.seq)

        bridge = AsyncBridge(asyncio.get_running_loop(), on_samples)
        try:
            bridge.deliver(camera_frame(0))
            await asyncio.wait_for(newest.get(), 5.0)
            for seq in numbers:  # meanwhile the loop is busy, and takes no samples
                bridge.deliver(camera_frame(seq))
            while await asyncio.wait_for(newest.get(), 5.0) != numbers[-1]:
                pass
        finally:
            bridge.close()

    asyncio.run(main())
    assert hub.model("a").rates["camera"].missing == missing
