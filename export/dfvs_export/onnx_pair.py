"""The two ONNX files of dfvs-flow and the names of their tensors; torch is not needed here."""

from __future__ import annotations

from dataclasses import dataclass

ENCODE_INPUTS = ("image",)
ENCODE_OUTPUTS = ("features_16", "features_8", "features_4")
MATCH_INPUTS = tuple(f"{side}_{name}" for side in ("first", "second") for name in ENCODE_OUTPUTS)
MATCH_OUTPUTS = ("flow", "confidence")


@dataclass(frozen=True, slots=True)
class OnnxPair:
    """Bytes of the two ONNX files."""

    encode: bytes
    match: bytes
