"""The matchers that can be asked for by name."""

from __future__ import annotations

from pathlib import Path

import cv2

from dfvs_core.errors import ModelError
from dfvs_core.manifest import MANIFEST_NAME, sha256
from dfvs_core.matching.classical import ClassicalMatcher
from dfvs_core.matching.hybrid import HybridMatcher
from dfvs_core.matching.matcher import Matcher
from dfvs_models.bundle import Bundle, read_bundle
from dfvs_models.encode_match import EncodeMatchMatcher
from dfvs_models.onnx_session import Execution
from dfvs_models.pair import PairMatcher

CLASSICAL = "classical"
_PACKAGED = Path(__file__).parent / "assets"


def load_matcher(
    name_or_path: str,
    threads: int = 2,
    provider: str = "CPUExecutionProvider",
    any_roll: bool = False,
) -> Matcher:
    """Load the matcher ``"classical"``, or a model bundle by its folder.

    The bundle's manifest says whether its network is used alone or as a hybrid, refined by the
    classical matcher; ``"alone:FOLDER"`` and ``"hybrid:FOLDER"`` choose. Bundles that come with
    this package go by their names alone, such as ``"dfvs-flow"``.

    ``threads`` goes to ONNX Runtime and, being what the classical parts run on, to OpenCV,
    where it holds for the whole process. ``any_roll`` is for cameras with six degrees of freedom:
    a hybrid looks for turned views too, where it finds next to nothing.

    Raises
    ------
    ModelError
        If there is no such matcher or provider, or its bundle cannot be used.
    """
    execution = Execution(threads, provider)
    cv2.setNumThreads(threads)
    if name_or_path == CLASSICAL:
        return ClassicalMatcher()
    matching, where = _split(name_or_path)
    bundle = read_bundle(_folder(where))
    network = network_matcher(bundle, execution)
    if (matching or bundle.manifest.matching) == "alone":
        return network
    return HybridMatcher(network, bundle.manifest.kind == "encode-match", any_roll)


def network_matcher(bundle: Bundle, execution: Execution) -> Matcher:
    """Load a bundle's network alone, with every check that is made before anything flies by it.

    Raises
    ------
    ModelError
        If the bundle gives no flow, its graphs are not what its manifest says, or the provider
        cannot be used.
    """
    kind = bundle.manifest.kind
    if kind == "mono":
        raise ModelError(
            f"bundle {bundle.manifest.name!r} is of the kind {kind!r}, which gives depth",
            f"the kinds 'pair' or 'encode-match', or {CLASSICAL!r}",
        )
    if kind == "encode-match":
        return EncodeMatchMatcher(bundle, execution)
    return PairMatcher(bundle, execution)


def _split(name_or_path: str) -> tuple[str, str]:
    """Take ``"hybrid:"`` or ``"alone:"`` off a name; without them the first part is empty."""
    for matching in ("alone", "hybrid"):
        if name_or_path.startswith(f"{matching}:"):
            return matching, name_or_path.removeprefix(f"{matching}:")
    return "", name_or_path


def model_files(name_or_path: str) -> dict[str, str]:
    """SHA-256 of every file that a matcher of :func:`load_matcher` consists of, by name.

    Empty for ``"classical"``, which is part of this package.

    Raises
    ------
    ModelError
        If there is no such matcher, or its bundle cannot be used.
    """
    if name_or_path == CLASSICAL:
        return {}
    manifest = read_bundle(_folder(_split(name_or_path)[1])).manifest
    return {MANIFEST_NAME: sha256(manifest.to_json().encode()), **manifest.files}


def packaged_bundles() -> dict[str, Path]:
    """Bundles that come with this package, by name."""
    return {path.parent.name: path.parent for path in sorted(_PACKAGED.glob(f"*/{MANIFEST_NAME}"))}


def bundle_folder(name_or_path: str) -> Path:
    """Folder of a bundle; those that come with this package go by their names alone.

    A folder of the same name is asked for as ``./NAME``.
    """
    return packaged_bundles().get(name_or_path, Path(name_or_path))


def _folder(name_or_path: str) -> Path:
    folder = bundle_folder(name_or_path)
    if not folder.exists():
        raise ModelError(
            f"there is no model {name_or_path!r}",
            f"{CLASSICAL!r} or the folder of a bundle ({MANIFEST_NAME} and its ONNX files)",
            f"bundles in this package: {', '.join(packaged_bundles()) or 'none'}",
        )
    return folder
