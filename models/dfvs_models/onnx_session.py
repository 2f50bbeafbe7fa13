"""ONNX Runtime session with fixed threads and execution provider."""

import contextlib
import functools
import os
import shutil
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import onnxruntime
from onnxruntime.capi import onnxruntime_pybind11_state as runtime_errors

from dfvs_common.progress import warn
from dfvs_core.errors import ModelError
from dfvs_core.geometry.arrays import Float32Array, ImageArray
from dfvs_core.messages.manifest import sha256
from dfvs_models.bundle import Bundle

_FATAL_ONLY = 4
_REMOTE = "AzureExecutionProvider"
"""Comes with every ONNX Runtime, takes no operator of a network, and would leave it to the CPU."""
_TENSORRT = "TensorrtExecutionProvider"
_WRITABLE_BY_OTHERS = 0o022
_KEPT_GRAPHS = 16
"""Graphs whose engines are kept, those used last; a service runs three or so."""
_GRAPH_FOLDERS = 64 * "[0-9a-f]" + "*"
_LOAD_ERRORS = (
    runtime_errors.Fail,
    runtime_errors.InvalidArgument,
    runtime_errors.InvalidGraph,
    runtime_errors.InvalidProtobuf,
    runtime_errors.NotImplemented,
    runtime_errors.RuntimeException,
    runtime_errors.EPFail,
    RuntimeError,
    ValueError,
)
"""What ONNX Runtime raises; they share no base but ``Exception``."""


@dataclass(frozen=True, slots=True)
class Execution:
    """On how many threads and with which of ONNX Runtime's providers a graph is run.

    TensorRT's engines are kept in the folder ``engine_cache``; where that is empty, or another
    user may write to it, they are built anew for every session.
    """

    threads: int = 2
    provider: str = "CPUExecutionProvider"
    engine_cache: str = ""

    def __post_init__(self) -> None:
        """Refuse a provider that this installation lacks: ONNX Runtime itself would only warn."""
        available = [p for p in onnxruntime.get_available_providers() if p != _REMOTE]
        if self.provider not in available:
            raise ModelError(
                f"ONNX Runtime has no provider {self.provider!r} here",
                f"one of {', '.join(available)}",
                "for another build: `pip uninstall --yes onnxruntime`, then "
                "`pip install --force-reinstall --no-deps WHEEL`",
            )


@dataclass(frozen=True, slots=True)
class TensorSpec:
    """A graph's tensor as the file declares it: name, element type and shape; 0 is any size."""

    name: str
    element: str
    shape: tuple[int, ...]


class OnnxGraph:
    """One graph of a bundle, ready to run; ``said`` is what the manifest says of it.

    Parameters
    ----------
    bundle : Bundle
    role : str
        The graph's, as the manifest names it.
    execution : Execution
        Threads and provider.
    free_axes : tuple of int
        Axes of the inputs whose size need not be fixed.

    Raises
    ------
    ModelError
        If the provider is not used, the graph cannot be loaded, or an input has
        no fixed shape.
    """

    def __init__(
        self, bundle: Bundle, role: str, execution: Execution, free_axes: tuple[int, ...] = ()
    ) -> None:
        self.said = bundle.manifest.graphs[role]
        data, name = bundle.graph(role), self.said.file
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = execution.threads
        options.inter_op_num_threads = 1
        options.log_severity_level = _FATAL_ONLY
        # Blocks planned ahead for a whole run took 14 MB more, and no less time.
        options.enable_mem_pattern = False
        # Spinning threads burn a core each between frames and slow everybody else down.
        options.add_session_config_entry("session.intra_op.allow_spinning", "0")
        try:
            self._session = onnxruntime.InferenceSession(
                data,
                options,
                providers=[execution.provider],
                provider_options=[provider_options(data, execution)],
                enable_fallback=0,
            )
        except _LOAD_ERRORS as error:
            raise ModelError(f"ONNX Runtime cannot load {name!r}: {_one_line(error)}") from error
        # It keeps the file's bytes only to start anew on another provider: nobody asks for that.
        self._session._model_bytes = None
        used = self._session.get_providers()
        if execution.provider not in used:
            raise ModelError(
                f"ONNX Runtime fell back to {', '.join(used)} for {name!r}", execution.provider
            )
        self.inputs = tuple(_spec(name, t, free_axes) for t in self._session.get_inputs())

    def run(self, tensors: Sequence[Float32Array]) -> list[Float32Array]:
        """Run the graph on tensors in the order of ``inputs``; give the outputs of the manifest.

        Raises
        ------
        ModelError
            If ONNX Runtime fails on them.
        """
        feeds = {spec.name: t for spec, t in zip(self.inputs, tensors, strict=True)}
        try:
            results = self._session.run(list(self.said.outputs), feeds)
        except _LOAD_ERRORS as error:
            raise ModelError(
                f"ONNX Runtime cannot run {self.said.file!r}: {_one_line(error)}"
            ) from error
        return [np.asarray(result) for result in results]

    def require_inputs(self) -> None:
        """Refuse a graph whose inputs have not the names that its manifest says.

        Raises
        ------
        ModelError
            Naming the inputs.
        """
        names = [spec.name for spec in self.inputs]
        if names != list(self.said.inputs):
            raise ModelError(
                f"{self.said.file!r} has the inputs {names}", f"{list(self.said.inputs)}"
            )

    def require_shapes(self, shapes: Sequence[tuple[int, ...]]) -> None:
        """Refuse a graph whose inputs have not the names that its manifest says, or other shapes.

        Raises
        ------
        ModelError
            Naming the input.
        """
        self.require_inputs()
        for found, shape in zip(self.inputs, shapes, strict=True):
            if found.shape != shape or found.element != "tensor(float)":
                raise ModelError(
                    f"input {found.name!r} of {self.said.file!r} is {found.element} of"
                    f" {found.shape}",
                    f"tensor(float) of {shape}",
                )

    def require_outputs(self) -> None:
        """Refuse a graph that lacks an output that its manifest names.

        Raises
        ------
        ModelError
            Naming the outputs.
        """
        outputs = {tensor.name for tensor in self._session.get_outputs()}
        if missing := sorted(set(self.said.outputs) - outputs):
            raise ModelError(f"{self.said.file!r} lacks the outputs {missing}")

    def require_values(
        self, outputs: Sequence[Float32Array], shapes: Sequence[tuple[int, ...]], expected: str
    ) -> None:
        """Refuse outputs of another type or shape, or that are not finite, as is ``expected``.

        Raises
        ------
        ModelError
            Naming the output.
        """
        for name, values, shape in zip(self.said.outputs, outputs, shapes, strict=True):
            where = f"output {name!r} of {self.said.file!r}"
            if values.shape != shape or values.dtype != np.float32:
                raise ModelError(
                    f"{where} is {values.dtype} of {values.shape}", f"float32 of {shape}"
                )
            if not np.isfinite(values).all():
                raise ModelError(
                    f"{where} has values that are not finite", expected, "its weights are damaged"
                )


def provider_options(data: bytes, execution: Execution) -> dict[str, str]:
    """Options of the provider for a graph: where TensorRT keeps its engine.

    Every graph has a folder by its bytes, since TensorRT's names of engines do not depend on
    weights, and by the version of ONNX Runtime, whose engines no other version uses.
    """
    if execution.provider != _TENSORRT or not execution.engine_cache:
        return {}
    folder = Path(execution.engine_cache) / f"{sha256(data)}-{onnxruntime.__version__}"
    if not _is_private(folder):
        _warn_once(
            f"TensorRT's engines cannot be kept in {folder.parent}, and are built at every start; "
            "expected a folder that this user, and no other, may write to"
        )
        return {}
    _delete_unused(folder)
    return {"trt_engine_cache_enable": "True", "trt_engine_cache_path": str(folder)}


def _is_private(folder: Path) -> bool:
    """Make a folder and the one around it; whether this user, and no other, may write there."""
    try:
        folder.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        folder.mkdir(mode=0o700, exist_ok=True)
        places = [path.stat() for path in (folder, folder.parent)]
    except OSError:
        return False
    return all(p.st_uid == os.geteuid() and not p.st_mode & _WRITABLE_BY_OTHERS for p in places)


def _delete_unused(used: Path) -> None:
    """Mark a graph's folder as the last one used, and delete those beyond ``_KEPT_GRAPHS``."""
    with contextlib.suppress(OSError):  # another service may delete some as well
        times = {path: path.stat().st_mtime_ns for path in used.parent.glob(_GRAPH_FOLDERS)}
        newest_ns = max(time.time_ns(), *times.values())  # the wall clock may have been set back
        os.utime(used, ns=(newest_ns, newest_ns))
        newest_first = sorted(times.keys() - {used}, key=times.__getitem__, reverse=True)
        for folder in newest_first[_KEPT_GRAPHS - 1 :]:
            shutil.rmtree(folder, ignore_errors=True)


@functools.cache
def _warn_once(text: str) -> None:
    warn(text)


def trial_image(width: int, height: int) -> ImageArray:
    """Grey ramp (height, width) that a network is tried out on."""
    return (np.add.outer(np.arange(height), np.arange(width)) % 256).astype(np.uint8)


def _spec(name: str, tensor: onnxruntime.NodeArg, free_axes: tuple[int, ...]) -> TensorSpec:
    shape = list(tensor.shape)
    is_free = [axis in free_axes and isinstance(n, str) for axis, n in enumerate(shape)]
    if not all(
        free or (isinstance(n, int) and n > 0) for n, free in zip(shape, is_free, strict=True)
    ):
        raise ModelError(f"input {tensor.name!r} of {name!r} has the shape {shape}", "fixed sizes")
    sizes = (0 if free else n for n, free in zip(shape, is_free, strict=True))
    return TensorSpec(tensor.name, tensor.type, tuple(sizes))


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split())[:300]
