"""Shards that the simulator writes are what the training reads."""

import numpy as np
import pytest

from dfvs_core.pair_files import PAIRS_PER_SHARD, shard_name
from dfvs_sim.pairs.drawing import PairArtist
from dfvs_sim.pairs.files import shard_arrays, write_arrays
from dfvs_sim.render.renderer import Renderer
from dfvs_sim.scene import builtin_room_path
from dfvs_sim.scene.glb import load_glb

torch = pytest.importorskip("torch", reason="needs the extra [export]")

from dfvs_export.data.pairs import PairSettings  # noqa: E402
from dfvs_export.data.stream import PairStream  # noqa: E402

SIZE = (64, 48)


def test_the_training_draws_from_the_shards_of_rendered_rooms(tmp_path):
    artist, rng = PairArtist(Renderer(load_glb(builtin_room_path()))), np.random.default_rng(6)
    pairs = [artist.training_pair(SIZE, rng) for _ in range(4)]
    arrays = shard_arrays(pairs * (PAIRS_PER_SHARD // 4))
    write_arrays(tmp_path / shard_name(SIZE, 5), arrays, compressed=False)
    stream = PairStream(tmp_path, PairSettings(*SIZE), batch=8, seed=1, wait_s=0.0)
    batch = stream.batch(0)
    assert batch.images.shape == (8, 2, 3, 48, 64)
    # the reader may mirror a pair, which leaves its mean as it is
    drawn = np.array([pair.views[0].image.mean() / 255.0 for pair in pairs])
    shown = batch.images[:, 0].mean(dim=(1, 2, 3)).numpy()
    assert np.abs(shown[:, None] - drawn).min(axis=1).max() < 1e-5
    # every flow that is seen leads back: the reader has both directions, in this order
    for k in range(8):
        seen = batch.visible[k, 0]
        j, i = torch.nonzero(seen, as_tuple=True)
        u, v = batch.flows[k, 0, 0][seen], batch.flows[k, 0, 1][seen]
        to_j = (j + 0.5 + v).floor().long().clamp(0, SIZE[1] - 1)  # half floats round
        to_i = (i + 0.5 + u).floor().long().clamp(0, SIZE[0] - 1)
        back = batch.flows[k, 1][:, to_j, to_i]
        assert float((torch.stack([u, v]) + back).norm(dim=0).median()) < 1.5
