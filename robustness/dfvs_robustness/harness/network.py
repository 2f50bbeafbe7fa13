"""A flow network that works, and that misbehaves on purpose when it sees a certain blue.

It fits the red and green ramps of ``wall.ramp_texture`` in both images by an affine map and
so knows the flow between them. The blue of the first image chooses what goes wrong: a network
that is damaged or was trained badly gives NaN or rubbish for some images and not for others as
well. It is an ordinary model bundle: the service has no part in the trick.
"""

import enum
import string
from pathlib import Path
from typing import Any

import numpy as np
import onnx.parser
from numpy.typing import NDArray
from onnx import numpy_helper

from dfvs_core.messages.manifest import MANIFEST_NAME, Graph, Manifest, sha256
from dfvs_core.messages.network_tensors import FlowOutput, ImageInput

WIDTH, HEIGHT = 160, 120
_FILE = "pair.onnx"
_GARBAGE_PX = 40.0


class Misbehaviour(enum.Enum):
    """What the network does, and the share of blue that makes it do so."""

    NAN = 0.1
    GARBAGE = 0.2
    ONE_WAY = 0.3
    """Flow there and flow back contradict each other: no point is to be trusted."""
    SLOW = 0.7
    STUCK = 0.9

    @property
    def blue(self) -> int:
        """Level of the blue channel, 0 to 255."""
        return round(255 * self.value)


_TRIPS = {Misbehaviour.SLOW: 400_000, Misbehaviour.STUCK: 1 << 50}
"""Rounds of the loop that delays the network."""
_GRAPH = """
<ir_version: 8, opset_import: ["": 17]>
ramp (float[1, 3, $height, $width] current, float[1, 3, $height, $width] other)
    => (float[1, 2, $height, $width] flow)
<
    int64[2] channels = {2, 1}, float tolerance = {0.04}, float shift_px = {9},
    # Keeps the flow finite where both ramps run the same way; on the wall it is 1e-5
    float least_det = {1e-9},
    bool always = {1}, float nought = {0}, float one = {1}, float[1] start = {0}
>
{
    # Red and green at the centre, and their slopes per px along u and v, each (2, 2, 1, 1)
    images = Concat<axis = 0>(current, other)
    colours, blues = Split<axis = 1>(images, channels)
    left, right = Split<axis = 3>(colours)
    top, bottom = Split<axis = 2>(colours)
    centres = ReduceMean<axes = [2, 3]>(colours)
    at_left = ReduceMean<axes = [2, 3]>(left) at_right = ReduceMean<axes = [2, 3]>(right)
    at_top = ReduceMean<axes = [2, 3]>(top) at_bottom = ReduceMean<axes = [2, 3]>(bottom)
    rise_u = Sub(at_right, at_left) slopes_u = Mul(rise_u, per_width)
    rise_v = Sub(at_bottom, at_top) slopes_v = Mul(rise_v, per_height)

    # Red and green of each pixel of the current image, from the centre of the other
    centre, other_centre = Split<axis = 0>(centres)
    along_u, other_u = Split<axis = 0>(slopes_u)
    along_v, other_v = Split<axis = 0>(slopes_v)
    by_u = Mul(along_u, u) by_v = Mul(along_v, v) rise = Add(by_u, by_v)
    offset = Sub(centre, other_centre) wanted = Add(rise, offset)

    # Where the other image has them: [[a, b], [c, d]] (at_u, at_v) = (red, green)
    a, c = Split<axis = 1>(other_u)
    b, d = Split<axis = 1>(other_v)
    red, green = Split<axis = 1>(wanted)
    ad = Mul(a, d) bc = Mul(b, c) ad_bc = Sub(ad, bc) det = Add(ad_bc, least_det)
    d_red = Mul(d, red) b_green = Mul(b, green) det_u = Sub(d_red, b_green)
    a_green = Mul(a, green) c_red = Mul(c, red) det_v = Sub(a_green, c_red)
    at_u = Div(det_u, det) flow_u = Sub(at_u, u)
    at_v = Div(det_v, det) flow_v = Sub(at_v, v)
    true_flow = Concat<axis = 1>(flow_u, flow_v)

    # 1 for the misbehaviour that the current image's blue asks for, else 0: (1, 1, 1, 5)
    blue, other_blue = Split<axis = 0>(blues)
    level = ReduceMean<axes = [2, 3]>(blue)
    difference = Sub(level, shares) off = Abs(difference) is_asked = Less(off, tolerance)
    asked = Cast<to = 1>(is_asked)
    nan, is_garbage, one_way, slow, stuck = Split<axis = 3>(asked)
    noise = Mul(garbage, is_garbage) noisy = Add(true_flow, noise)
    shift = Mul(shift_px, one_way) shifted = Add(noisy, shift)

    # Zero (1,), after as many rounds of a loop as were asked for
    counts = Cast<to = 7>(asked) asked_trips = Mul(counts, trips)
    all_trips = ReduceSum<keepdims = 0>(asked_trips)
    delay = Loop(all_trips, always, start) <body = round (int64 i, bool go, float[1] x)
        => (bool on, float[1] y) { on = Identity(go) y = Sin(x) }>
    late = Add(shifted, delay)

    # 0 / 0 where chosen
    zero = Mul(nan, nought) rest = Sub(one, nan) share = Div(zero, rest)
    flow = Add(late, share)
}
"""


def faulty_network() -> onnx.ModelProto:
    """Build the network."""
    text = string.Template(_GRAPH).substitute(width=WIDTH, height=HEIGHT)
    model = onnx.parser.parse_model(text)
    garbage = np.random.default_rng(0).normal(0.0, _GARBAGE_PX, (1, 2, HEIGHT, WIDTH))
    constants: dict[str, NDArray[Any]] = {
        "u": (np.arange(WIDTH) + 0.5 - WIDTH / 2).astype(np.float32),
        "v": (np.arange(HEIGHT) + 0.5 - HEIGHT / 2).astype(np.float32)[:, None],
        "per_width": np.array(2.0 / WIDTH, np.float32),
        "per_height": np.array(2.0 / HEIGHT, np.float32),
        "garbage": garbage.astype(np.float32),
        "shares": np.array([what.value for what in Misbehaviour], np.float32),
        "trips": np.array([_TRIPS.get(what, 0) for what in Misbehaviour], np.int64),
    }
    model.graph.initializer.extend(
        numpy_helper.from_array(values, name) for name, values in constants.items()
    )
    onnx.checker.check_model(model)
    return model


def write_bundle(folder: Path) -> Path:
    """Write the network as a model bundle; returns its folder."""
    folder.mkdir(parents=True, exist_ok=True)
    data = faulty_network().SerializeToString()
    (folder / _FILE).write_bytes(data)
    manifest = Manifest(
        format="dfvs-bundle/2",
        name="faulty-ramp",
        kind="pair",
        input=ImageInput(WIDTH, HEIGHT),
        graphs={"pair": Graph(_FILE, ("current", "other"), ("flow",))},
        files={_FILE: sha256(data)},
        licence="Apache-2.0",
        origin="built by dfvs_robustness.harness.network, to misbehave on purpose",
        flow=FlowOutput(),
    )
    (folder / MANIFEST_NAME).write_text(manifest.to_json(), encoding="utf-8")
    return folder
