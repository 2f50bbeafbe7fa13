"""LighterGlue with its linear maps folded, beside the published network written out in full."""

import pytest
import torch
from torch.nn import functional

from dfvs_export.networks.lighterglue import LighterGlue, attended
from dfvs_export.networks.xfeat import Keypoints
from dfvs_export.weights.flow import folded

SIZE = (640, 480)
WIDTH, INPUTS, LAYERS = 96, 64, 6


def published_state(seed):
    """Weights drawn at random, under the names of the published network."""
    made = {"posenc.Wr": (WIDTH // 2, 2)}
    biased = {"input_proj": (WIDTH, INPUTS)}
    for k in range(LAYERS):
        for name, maps in (("self_attn", {"Wqkv": 3, "out_proj": 1}), ("cross_attn", {})):
            maps = maps or {"to_qk": 1, "to_v": 1, "to_out": 1}
            biased |= {f"transformers.{k}.{name}.{m}": (n * WIDTH, WIDTH) for m, n in maps.items()}
            biased[f"transformers.{k}.{name}.ffn.0"] = (2 * WIDTH, 2 * WIDTH)
            biased[f"transformers.{k}.{name}.ffn.1"] = (2 * WIDTH,)
            biased[f"transformers.{k}.{name}.ffn.3"] = (WIDTH, 2 * WIDTH)
        biased[f"log_assignment.{k}.final_proj"] = (WIDTH, WIDTH)
        biased[f"log_assignment.{k}.matchability"] = (1, WIDTH)
    generator = torch.Generator().manual_seed(seed)

    def drawn(*shape):
        return torch.randn(*shape, generator=generator) / shape[-1] ** 0.5

    state = {f"{name}.weight": drawn(*shape) for name, shape in (made | biased).items()}
    return state | {f"{name}.bias": drawn(shape[0]) for name, shape in biased.items()}


class Published:
    """The published network, map by map."""

    def __init__(self, state):
        self.state = state

    def linear(self, name, x):
        return functional.linear(x, self.state[f"{name}.weight"], self.state.get(f"{name}.bias"))

    def updated(self, name, x, message):
        wide = self.linear(f"{name}.ffn.0", torch.cat([x, message], dim=-1))
        weights = (self.state[f"{name}.ffn.1.{kind}"] for kind in ("weight", "bias"))
        wide = functional.gelu(functional.layer_norm(wide, wide.shape[-1:], *weights))
        return x + self.linear(f"{name}.ffn.3", wide)

    def self_attention(self, name, x, points):
        q, k, v = self.linear(f"{name}.Wqkv", x).unflatten(-1, (WIDTH, 3)).unbind(-1)
        middle = torch.tensor(SIZE) / 2
        angle = self.linear("posenc.Wr", (points - middle) / (max(SIZE) / 2))
        q, k = (self.turned(each, angle) for each in (q, k))
        similar = q @ k.transpose(-1, -2) / WIDTH**0.5
        return self.updated(name, x, self.linear(f"{name}.out_proj", similar.softmax(-1) @ v))

    def turned(self, x, angle):
        pairs = torch.view_as_complex(x.unflatten(-1, (-1, 2)).contiguous())
        return torch.view_as_real(pairs * torch.polar(torch.ones_like(angle), angle)).flatten(-2)

    def cross_attention(self, name, x, other):
        q, k = self.linear(f"{name}.to_qk", x), self.linear(f"{name}.to_qk", other)
        similar = q @ k.transpose(-1, -2) / WIDTH**0.5
        message = similar.softmax(-1) @ self.linear(f"{name}.to_v", other)
        return self.updated(name, x, self.linear(f"{name}.to_out", message))

    def log_probability(self, first, second):
        x, y = (self.linear("input_proj", side.descriptors) for side in (first, second))
        for k in range(LAYERS):
            name = f"transformers.{k}.self_attn"
            x = self.self_attention(name, x, first.points)
            y = self.self_attention(name, y, second.points)
            name = f"transformers.{k}.cross_attn"
            x, y = self.cross_attention(name, x, y), self.cross_attention(name, y, x)
        name = f"log_assignment.{LAYERS - 1}"
        a, b = (self.linear(f"{name}.final_proj", each) for each in (x, y))
        similar = a @ b.transpose(-1, -2) / WIDTH**0.5
        log = similar.log_softmax(-1) + similar.log_softmax(-2)
        a, b = (functional.logsigmoid(self.linear(f"{name}.matchability", e)) for e in (x, y))
        return log + a + b.transpose(-1, -2)


def keypoints(count, generator):
    points = torch.rand(1, count, 2, generator=generator) * torch.tensor(SIZE)
    descriptors = functional.normalize(torch.randn(1, count, INPUTS, generator=generator), dim=-1)
    return Keypoints(points, descriptors)


@pytest.mark.parametrize("counts", [(30, 30), (40, 25)])
def test_folded_linear_maps_compute_what_the_published_network_does(counts):
    state = published_state(seed=counts[1])
    network = LighterGlue(SIZE).eval()
    network.load_state_dict(folded(state))
    generator = torch.Generator().manual_seed(1)
    first, second = (keypoints(count, generator) for count in counts)
    with torch.no_grad():
        found = network(first, second).log_probability
        expected = Published(state).log_probability(first, second)
    torch.testing.assert_close(found, expected, atol=2e-3, rtol=1e-3)
    assert expected.std() > 0.1


def test_no_attention_has_weights_that_are_subnormal():
    """Processors are slow with them."""
    logits = -torch.arange(120.0)[None, None]
    weights = attended(logits, torch.eye(120)[None])
    torch.testing.assert_close(weights, torch.softmax(logits, dim=-1), atol=1e-30, rtol=1e-6)
    assert weights.min() >= torch.finfo(torch.float32).tiny
