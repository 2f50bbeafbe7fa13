"""Converts a published network and runs it as the service does; one line of JSON.

A process of its own, started by the tests: the operators that it defines stay in it.
"""

import json
import sys
from pathlib import Path

import numpy as np

SIZE = (128, 128)


def define_what_torchvision_needs() -> None:
    """Let ptlflow be imported beside a torch for processors only.

    ptlflow imports torchvision, whose compiled operators such a torch lacks, and two of which it
    looks for when it is imported. None of the networks here uses them: a schema without a body
    is enough.
    """
    import torch

    if hasattr(torch.ops.torchvision, "nms") or _torchvision_fits():
        return
    library = torch.library.Library("torchvision", "DEF")
    for name in ("nms", "qnms"):
        library.define(f"{name}(Tensor dets, Tensor scores, float iou_threshold) -> Tensor")
    # schemas live as long as the library object does
    globals()["_library"] = library


def _torchvision_fits() -> bool:
    try:
        import torchvision  # noqa: F401
    except (ImportError, RuntimeError):
        for name in [name for name in sys.modules if name.startswith("torchvision")]:
            del sys.modules[name]  # half imported
        return False
    return True


def convert(name: str, folder: Path) -> dict[str, object]:
    from dfvs_export.bundles.bundle import write_bundle
    from dfvs_export.bundles.published_flow import PublishedFlow
    from dfvs_export.bundles.runner import BundleRunner
    from dfvs_export.checks.parity import parity
    from dfvs_models.catalog import load_matcher

    network = PublishedFlow.load(name)
    bundle = network.bundle(SIZE)
    write_bundle(folder / name, bundle, network.card(bundle.manifest, {}, ""), {})
    rng = np.random.default_rng(0)
    first, second = (rng.integers(0, 256, (SIZE[1], SIZE[0], 3), dtype=np.uint8) for _ in "ab")
    agreement = parity(network, BundleRunner(bundle, threads=1), [(first, second)])
    matcher = load_matcher(str(folder / name), threads=1)
    field = matcher.match(matcher.encode(first), matcher.encode(second))
    return {
        "greatest_px": agreement.greatest,
        "shape": field.flow.shape,
        "finite": field.is_finite(),
        "greatest_flow_px": float(np.abs(field.flow).max()),
    }


if __name__ == "__main__":
    define_what_torchvision_needs()
    print(json.dumps(convert(sys.argv[2], Path(sys.argv[1]))))
