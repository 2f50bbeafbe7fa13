"""Catalogue of the matchers and networks by name."""

import os
from pathlib import Path

import cv2

from dfvs_core.errors import ModelError
from dfvs_core.matching.classical import classical_matcher
from dfvs_core.matching.config import MatchingConfig
from dfvs_core.matching.matcher import Matcher
from dfvs_core.matching.staged import StagedMatcher
from dfvs_core.messages.manifest import MANIFEST_NAME, sha256
from dfvs_core.servo.config import BY_NETWORK, DepthChoice
from dfvs_models import DEFAULT_MATCHER
from dfvs_models.bundle import Bundle, read_bundle
from dfvs_models.depth import DepthNetwork
from dfvs_models.encode_match import EncodeMatchPoints
from dfvs_models.onnx_session import Execution
from dfvs_models.pair import FlowPoints, PairMatcher
from dfvs_models.pose import PoseNetwork

CLASSICAL = "classical"
_HYBRID = "hybrid:"
_PAIR = f"{_HYBRID!r} and a bundle of the kind 'pair'"
_PACKAGED = Path(__file__).parent / "assets"
_NO_MATCHERS = {"mono": "depth", "pose": "a pose"}
"""What bundles give that give no matches, by kind."""


def load_matcher(
    name_or_path: str | os.PathLike[str] = DEFAULT_MATCHER,
    threads: int = 2,
    provider: str = "CPUExecutionProvider",
    config: MatchingConfig | None = None,
    engine_cache: str = "",
) -> Matcher:
    """Load a matcher, the source of dense correspondences.

    Parameters
    ----------
    name_or_path : str or path
        Name of a bundle in this package, folder of any other bundle, or ``"classical"``, which
        needs no network. A path object is always a folder. The flow of a ``pair`` bundle is used
        as it is, or after ``"hybrid:"`` made precise by the dense search.
    threads : int
        Of ONNX Runtime and OpenCV; for OpenCV it holds in the whole process.
    provider : str
        Execution provider of ONNX Runtime.
    config : MatchingConfig, optional
        Numbers of relocalisation and tracking.
    engine_cache : str
        Folder in which TensorRT's engines are kept; see ``Execution``.

    Raises
    ------
    ModelError
        If there is no such matcher or provider, or its bundle cannot be used.

    Examples
    --------
    >>> matcher = load_matcher()
    >>> load_matcher("no-such-model")  # doctest: +ELLIPSIS
    Traceback (most recent call last):
    ...
    dfvs_core.errors.ModelError: there is no model 'no-such-model'; expected 'classical' or ...
    """
    name_or_path = _as_text(name_or_path)
    execution = Execution(threads, provider, engine_cache)
    cv2.setNumThreads(threads)
    if name_or_path == CLASSICAL:
        return classical_matcher(config)
    network, is_hybrid = name_or_path.removeprefix(_HYBRID), name_or_path.startswith(_HYBRID)
    if network == CLASSICAL:
        raise ModelError(f"{name_or_path!r} names no network", _PAIR)
    return network_matcher(read_bundle(_folder(network)), execution, is_hybrid, config)


def network_matcher(
    bundle: Bundle,
    execution: Execution,
    is_hybrid: bool = False,
    config: MatchingConfig | None = None,
) -> Matcher:
    """Load a bundle as a matcher, with every check that is made before anything flies by it.

    Raises
    ------
    ModelError
        If the bundle gives no matches, its graphs are not what its manifest says, or the provider
        cannot be used.
    """
    kind = bundle.manifest.kind
    if kind in _NO_MATCHERS:
        raise ModelError(
            f"bundle {bundle.manifest.name!r} is of the kind {kind!r}, which gives"
            f" {_NO_MATCHERS[kind]}",
            f"the kinds 'pair' or 'encode-match', or {CLASSICAL!r}",
        )
    if kind == "encode-match":
        if is_hybrid:
            raise ModelError(
                f"{_HYBRID!r} before a bundle of the kind {kind!r}, which is made precise anyway",
                _PAIR,
                f"leave {_HYBRID!r} out",
            )
        config = config or MatchingConfig()
        return StagedMatcher(
            EncodeMatchPoints(bundle, execution, config.turns_rad, config.scales), config
        )
    network = PairMatcher(bundle, execution)
    return StagedMatcher(FlowPoints(network), config) if is_hybrid else network


def load_depth(
    choice: DepthChoice,
    name_or_path: str | os.PathLike[str],
    threads: int = 2,
    provider: str = "CPUExecutionProvider",
    engine_cache: str = "",
) -> DepthNetwork | None:
    """Load the ``mono`` bundle that a choice of depth needs; None where it needs none.

    Raises
    ------
    ModelError
        If there is no such bundle or provider, it cannot be used, or not for this choice.
    """
    if choice not in BY_NETWORK:
        return None
    network = load_depth_network(name_or_path, threads, provider, engine_cache)
    if choice == "network" and network.unit == "affine":
        raise ModelError(
            f"depth of {str(name_or_path)!r} has an unknown offset, and servo.depth is 'network'",
            "a network without one, or servo.depth = 'fused', which learns it from motion",
        )
    return network


def load_depth_network(
    name_or_path: str | os.PathLike[str],
    threads: int = 2,
    provider: str = "CPUExecutionProvider",
    engine_cache: str = "",
) -> DepthNetwork:
    """Load a ``mono`` bundle.

    Raises
    ------
    ModelError
        If there is no such bundle or provider, or it cannot be used.
    """
    folder = _folder(_as_text(name_or_path), "the folder of a depth bundle")
    return DepthNetwork(read_bundle(folder), Execution(threads, provider, engine_cache))


def load_pose(name_or_path: str | os.PathLike[str], threads: int = 2) -> PoseNetwork:
    """Load a ``pose`` bundle.

    Raises
    ------
    ModelError
        If there is no such bundle, or it cannot be used.
    """
    folder = _folder(_as_text(name_or_path), "the folder of a pose bundle")
    return PoseNetwork(read_bundle(folder), Execution(threads))


def depth_files(choice: DepthChoice, name_or_path: str) -> dict[str, str]:
    """SHA-256 of every file of the bundle of :func:`load_depth`, by ``depth/`` and its name.

    Raises
    ------
    ModelError
        If there is no such bundle, or it cannot be used.
    """
    if choice not in BY_NETWORK:
        return {}
    return {f"depth/{name}": digest for name, digest in model_files(name_or_path).items()}


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
    manifest = read_bundle(_folder(name_or_path.removeprefix(_HYBRID))).manifest
    return {MANIFEST_NAME: sha256(manifest.to_json().encode()), **manifest.files}


def packaged_bundles() -> dict[str, Path]:
    """Bundles that come with this package, by name."""
    return {path.parent.name: path.parent for path in sorted(_PACKAGED.glob(f"*/{MANIFEST_NAME}"))}


def bundle_folder(name_or_path: str) -> Path:
    """Folder of a bundle; those that come with this package go by their names alone.

    A folder of the same name is asked for as ``./NAME``.
    """
    return packaged_bundles().get(name_or_path, Path(name_or_path))


def _as_text(name_or_path: str | os.PathLike[str]) -> str:
    """Name or folder; a path object is never the name of a bundle in this package."""
    return name_or_path if isinstance(name_or_path, str) else os.path.abspath(name_or_path)


def _folder(name_or_path: str, wanted: str = f"{CLASSICAL!r} or the folder of a bundle") -> Path:
    folder = bundle_folder(name_or_path)
    if not folder.exists():
        raise ModelError(
            f"there is no model {name_or_path!r}",
            f"{wanted} ({MANIFEST_NAME} and its ONNX files)",
            f"bundles in this package: {', '.join(packaged_bundles()) or 'none'}",
        )
    return folder
