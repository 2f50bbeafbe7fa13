"""The operators of a bundle's graphs."""

import io
from collections import Counter
from collections.abc import Mapping

import onnx

from dfvs_core.errors import ModelError


def operators(contents: Mapping[str, bytes]) -> Counter[str]:
    """Count the operators of all ONNX files.

    Raises
    ------
    ModelError
        If a file is not valid ONNX, or uses operators outside ONNX's own.
    """
    counts: Counter[str] = Counter()
    for name, data in contents.items():
        if not name.endswith(".onnx"):
            continue
        model = onnx.load_model(io.BytesIO(data))
        try:
            onnx.checker.check_model(model)
        except onnx.checker.ValidationError as error:
            raise ModelError(f"{name} is not valid ONNX: {error}") from error
        foreign = {node.domain for node in model.graph.node} - {"", "ai.onnx"}
        if foreign:
            raise ModelError(f"{name} uses operators of {sorted(foreign)}", "ONNX's own only")
        counts.update(node.op_type for node in model.graph.node)
    return counts
