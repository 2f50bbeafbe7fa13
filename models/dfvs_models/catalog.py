"""The matchers that can be asked for by name."""

from __future__ import annotations

from pathlib import Path

import cv2

from dfvs_core.errors import ModelError
from dfvs_core.manifest import MANIFEST_NAME, sha256
from dfvs_core.matching.classical import ClassicalMatcher
from dfvs_core.matching.hybrid import HybridMatcher
from dfvs_core.matching.matcher import Matcher
from dfvs_models.bundle import read_bundle
from dfvs_models.encode_match import EncodeMatchMatcher
from dfvs_models.onnx_session import Execution
from dfvs_models.pair import PairMatcher

CLASSICAL = "classical"
HYBRID_PREFIX = "hybrid:"
_PACKAGED = Path(__file__).parent / "assets"


def load_matcher(
    name_or_path: str, threads: int = 2, provider: str = "CPUExecutionProvider"
) -> Matcher:
    """Load the matcher ``"classical"``, a model bundle by its folder, or ``"hybrid:FOLDER"``.

    A hybrid is the classical matcher that asks the bundle's network where it is at a loss. Bundles
    that come with this package go by their names alone, such as ``"hybrid:dfvs-flow"``.

    ``threads`` goes to ONNX Runtime and, being what the classical parts run on, to OpenCV,
    where it holds for the whole process.

    Raises
    ------
    ModelError
        If there is no such matcher, or its bundle cannot be used.
    """
    cv2.setNumThreads(threads)
    if name_or_path == CLASSICAL:
        return ClassicalMatcher()
    if name_or_path.startswith(HYBRID_PREFIX):
        network = load_matcher(name_or_path.removeprefix(HYBRID_PREFIX), threads, provider)
        return HybridMatcher(network)
    folder = _folder(name_or_path)
    bundle = read_bundle(folder)
    kind = bundle.manifest.kind
    if kind == "mono":
        raise ModelError(
            f"bundle {bundle.manifest.name!r} is of the kind {kind!r}, which gives depth",
            f"the kinds 'pair' or 'encode-match', or {CLASSICAL!r}",
        )
    execution = Execution(threads, provider)
    if kind == "encode-match":
        return EncodeMatchMatcher(bundle, execution)
    return PairMatcher(bundle, execution)


def model_files(name_or_path: str) -> dict[str, str]:
    """SHA-256 of every file that a matcher of :func:`load_matcher` consists of, by name.

    Empty for ``"classical"``, which is part of this package.

    Raises
    ------
    ModelError
        If there is no such matcher, or its bundle cannot be used.
    """
    name_or_path = name_or_path.removeprefix(HYBRID_PREFIX)
    if name_or_path == CLASSICAL:
        return {}
    manifest = read_bundle(_folder(name_or_path)).manifest
    return {MANIFEST_NAME: sha256(manifest.to_json().encode()), **manifest.files}


def packaged_bundles() -> dict[str, Path]:
    """Bundles that come with this package, by name."""
    return {path.parent.name: path.parent for path in sorted(_PACKAGED.glob(f"*/{MANIFEST_NAME}"))}


def _folder(name_or_path: str) -> Path:
    packaged = packaged_bundles()  # a folder of the same name is asked for as ./NAME
    if name_or_path in packaged:
        return packaged[name_or_path]
    folder = Path(name_or_path)
    if not folder.exists():
        raise ModelError(
            f"there is no model {name_or_path!r}",
            f"{CLASSICAL!r} or the folder of a bundle ({MANIFEST_NAME} and its ONNX files)",
            f"bundles in this package: {', '.join(packaged) or 'none'}",
        )
    return folder
