import asyncio

from dfvs_service.dashboard.async_bridge import AsyncBridge
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
