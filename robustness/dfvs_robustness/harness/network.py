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


def faulty_network() -> onnx.ModelProto:
    """Build the network."""
    graph = string.Template(Path(__file__).with_suffix(".onnxtxt").read_text(encoding="utf-8"))
    model = onnx.parser.parse_model(graph.substitute(width=WIDTH, height=HEIGHT))
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
