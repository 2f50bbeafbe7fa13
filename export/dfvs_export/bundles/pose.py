"""Networks that regress poses as ``pose`` bundles."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch

from dfvs_core.geometry.arrays import Float32Array
from dfvs_core.messages.manifest import Manifest
from dfvs_core.messages.network_tensors import ImageInput, PoseOutput
from dfvs_export.bundles.bundle import Source, make_bundle
from dfvs_export.bundles.card import model_card
from dfvs_export.bundles.runner import FOCAL, BundleRunner, ImagePair
from dfvs_export.bundles.tracing import TensorNames, trace
from dfvs_export.networks.pose_regression import SIZE, PoseNet
from dfvs_export.weights.pose import TrainedPose, load_pose_weights
from dfvs_models.bundle import Bundle

_TENSORS: TensorNames = (("first", "second", "focal"), ("translation", "rotation"))
_AFTER = {
    "saxena": "Saxena et al. (ICRA 2017): convolutions on both images stacked",
    "bateux": "Bateux et al. (ICRA 2018): a Siamese encoder of ImageNet, trained on planes",
}
_ABOUT = """\
Pose of a goal image's camera in the current one's, from both images; a baseline of the benchmark,
after {after}.

- Input: two grey images of {m.input.width} x {m.input.height} px, and their focal \
length over the width.
- Output: translation in depths and rotation vector. Precision: {m.precision}.
- {parameters:.2f} million parameters. Origin: {m.origin}.
- Licence: {m.licence}."""
_ACCURACY = "Not measured for this bundle: see `dfvs-bench scenes --setting` and `table1`."
_LIMITS = """\
- Views that share little, and motion beyond that of its training.
- The unit of its translation: lengths come in depths of the goal view, as if all were one plane."""


@dataclass(frozen=True, slots=True)
class PoseModel:
    """A pose network in torch with its weights."""

    weights: TrainedPose
    module: PoseNet

    @classmethod
    def load(cls, path: Path) -> PoseModel:
        """Read a checkpoint of ``train-pose``.

        Raises
        ------
        ModelError
            If the weights cannot be used.
        """
        weights = load_pose_weights(path)
        return cls(weights, weights.network())

    def bundle(self) -> Bundle:
        """Bundle in fp32 for images of the network's size."""
        width, height = SIZE
        images = torch.rand(2, 1, height, width, generator=torch.Generator().manual_seed(0))
        example = (images[:1], images[1:], torch.full((1, 1), FOCAL))
        onnx = trace(self.module, example, _TENSORS)
        grey = ImageInput(width, height, 16, channels="grey", mean=(0.5,), std=(0.5,))
        output = PoseOutput("depth", "vector")
        weights = self.weights
        origin = f"{weights.origin}, trained by this project, weights {weights.digest}"
        source = Source(weights.name, origin, "Apache-2.0")
        return make_bundle("pose", {"pose": (onnx, _TENSORS)}, grey, source, pose=output)

    def differences(self, runner: BundleRunner, pair: ImagePair) -> Float32Array:
        """How far the pose of ONNX Runtime is from torch's: depths and rad."""
        first, second = (runner.encode(image) for image in pair)
        tensors = [torch.from_numpy(t) for t in (first[0], second[0], first[1])]
        with torch.no_grad():
            expected = self.module(*tensors)
        found = runner.match(first, second)
        apart = [np.abs(a - b.numpy()).ravel() for a, b in zip(found, expected, strict=True)]
        return np.concatenate(apart)

    def card(self, manifest: Manifest) -> str:
        """Text of the model card."""
        about = _ABOUT.format(
            m=manifest,
            after=_AFTER[manifest.name],
            parameters=sum(value.numel() for value in self.weights.state.values()) / 1e6,
        )
        return model_card(manifest.name, about, _ACCURACY, self.weights.training, _LIMITS)
