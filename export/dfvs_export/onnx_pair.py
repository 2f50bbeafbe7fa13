"""The two ONNX files of dfvs-flow and the names of their tensors; torch is not needed here."""

from __future__ import annotations

from dataclasses import dataclass

ENCODE_INPUTS = ("image",)
ENCODE_OUTPUTS = ("features_16", "features_8", "features_4", "normalised")
MATCH_INPUTS = (  # of the first image all but the image itself
    *(f"first_{name}" for name in ENCODE_OUTPUTS[:3]),
    *(f"second_{name}" for name in ENCODE_OUTPUTS),
)
MATCH_OUTPUTS = ("flow", "confidence")


@dataclass(frozen=True, slots=True)
class OnnxPair:
    """Bytes of the two ONNX files."""

    encode: bytes
    match: bytes
