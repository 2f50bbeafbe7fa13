"""Pose network of a ``pose`` bundle."""

import numpy as np

from dfvs_core.errors import ModelError
from dfvs_core.geometry.arrays import FloatArray, ImageArray
from dfvs_core.geometry.camera import CameraModel
from dfvs_core.geometry.poses import make_pose, rotation_from_quaternion, so3_exp
from dfvs_models.bundle import Bundle
from dfvs_models.depth import FOCAL_SHAPE, FittedImage, fit_image, trial_view
from dfvs_models.onnx_session import Execution, OnnxGraph
from dfvs_models.pair import image_tensor, pair_tensors


class PoseNetwork:
    """Runs a ``pose`` bundle. Distortion is not taken out of images.

    Raises
    ------
    ModelError
        If the graph's tensors are not what the manifest says, or its output is not finite.
    """

    def __init__(self, bundle: Bundle, execution: Execution) -> None:
        manifest = bundle.manifest
        if manifest.pose is None:
            raise ModelError(
                f"bundle {manifest.name!r} is of the kind {manifest.kind!r}, which gives no pose",
                "a bundle of the kind 'pose'",
            )
        self._input, self._meaning = manifest.input, manifest.pose
        self._graph = OnnxGraph(bundle, "pose", execution)
        self._graph.require_shapes((*self._input.pair_shapes(), FOCAL_SHAPE))
        self._try_out()

    @property
    def unit(self) -> str:
        """Of the translation; see ``dfvs_core.messages.manifest.PoseOutput``."""
        return self._meaning.unit

    def fit(self, image: ImageArray, camera: CameraModel) -> FittedImage:
        """Image in the network's size, its pixels square, of one (H, W, 3) uint8 RGB."""
        return fit_image(image, camera, self._input)

    def relative_pose(self, first: FittedImage, second: FittedImage) -> FloatArray:
        """``T_first_second`` (4, 4) of two images that :meth:`fit` gave of the same camera.

        Raises
        ------
        ModelError
            If the network gives values that are not finite, or no rotation.
        """
        images = [image_tensor(side.image, self._input) for side in (first, second)]
        focal = np.full(FOCAL_SHAPE, first.focal, np.float32)
        tensors = pair_tensors(images[0], images[1], self._input)
        raw = self._graph.run((*tensors, focal))
        self._graph.require_values(raw, self._meaning.shapes, "a finite pose")
        translation, rotation = (values[0].astype(np.float64) for values in raw)
        is_vector = self._meaning.rotation == "vector"
        if not (is_vector or rotation.any()):
            said = self._graph.said
            where = f"output {said.outputs[1]!r} of {said.file!r}"
            raise ModelError(f"{where} is a quaternion of zeros", "a rotation")
        R = so3_exp(rotation) if is_vector else rotation_from_quaternion(rotation)
        return make_pose(R, translation)

    def _try_out(self) -> None:
        """Run the network once: shapes that lie and weights that are not finite show up."""
        self._graph.require_outputs()
        view = trial_view(self._input)
        self.relative_pose(view, view)
