"""Published depth networks with their weights."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from torch import nn

from dfvs_core.errors import ModelError
from dfvs_export.networks.densedepth import DenseDepth
from dfvs_export.networks.depth_anything import WEIGHTS_NAME, DepthAnything
from dfvs_export.networks.midas_small import MidasSmall
from dfvs_export.weights.checkpoint import checked_digest, fill
from dfvs_export.weights.published import read_state

DENSE, ANYTHING, MIDAS = "densedepth", "depth-anything-v2-small", "midas-small"


@dataclass(frozen=True, slots=True)
class DepthWeights:
    """Where weights come from; none: random ones of a fixed seed, to try the path with.

    ``folder`` is one that ``transformers`` saved; ``sha256`` what published weights hash to.
    """

    checkpoint: Path | None = None
    folder: Path | None = None
    sha256: str | None = None

    @property
    def is_random(self) -> bool:
        """Whether none are named."""
        return self.checkpoint is None and self.folder is None

    @property
    def origin(self) -> str:
        """Where they come from, in words."""
        if self.is_random:
            return "RANDOM weights, only to try out"
        return f"weights {(self.checkpoint or self.folder or Path()).name}"


def _dense(weights: DepthWeights) -> nn.Module:
    return _filled(DenseDepth(), weights, "head.bias", 3.0)  # within the range of its output


def _midas(weights: DepthWeights) -> nn.Module:
    network = MidasSmall()
    return _filled(network, weights, "scratch.output_conv.4.bias", 1.0)  # cut off below 0


def _anything(weights: DepthWeights) -> nn.Module:
    if weights.folder is None:
        return DepthAnything()
    _read(weights.folder / WEIGHTS_NAME, weights.sha256)
    return DepthAnything(weights.folder)


LOADERS: Mapping[str, Callable[[DepthWeights], nn.Module]] = {
    DENSE: _dense,
    ANYTHING: _anything,
    MIDAS: _midas,
}


def _filled(network: nn.Module, weights: DepthWeights, bias: str, drawn: float) -> nn.Module:
    """The network with published weights, or where none are named with ``bias`` set to a value."""
    path = weights.checkpoint
    if path is None:
        nn.init.constant_(network.get_parameter(bias), drawn)
        return network
    state = read_state(_read(path, weights.sha256), path.name)
    fill(network, state, f"{path} does not fit the network", "weights for it")
    return network


def _read(path: Path, sha256: str | None) -> bytes:
    """Bytes of a file whose hash is the one that was named."""
    try:
        data = path.read_bytes()
    except OSError as error:
        raise ModelError(f"{path} cannot be read ({error.strerror})") from error
    return checked_digest(data, str(path), sha256)
