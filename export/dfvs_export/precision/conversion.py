"""A bundle's graphs with fewer bits."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Literal

from dfvs_export.bundles.manifest import hashes
from dfvs_export.bundles.runner import BundleRunner, ImagePair
from dfvs_export.precision.calibration import graph_feeds
from dfvs_export.precision.half import to_half
from dfvs_export.precision.heavy_nodes import heavy_nodes
from dfvs_export.precision.int8 import to_int8
from dfvs_models.bundle import Bundle

Precision = Literal["fp32", "fp16", "int8"]


def in_precision(bundle: Bundle, precision: Precision, frames: Sequence[ImagePair]) -> Bundle:
    """Return the bundle with its heavy operators in another precision.

    Parameters
    ----------
    bundle : Bundle
        A bundle in fp32.
    precision : str
        ``"fp32"`` gives the bundle back as it is.
    frames : sequence of ImagePair
        Images of the bundle's size, to calibrate int8 on.
    """
    if precision == "fp32":
        return bundle
    feeds = graph_feeds(BundleRunner(bundle), frames) if precision == "int8" else {}
    manifest, contents = bundle.manifest, dict(bundle.contents)
    for role, graph in manifest.graphs.items():
        choose = partial(heavy_nodes, takes_images=role != "match")
        data = contents[graph.file]
        if precision == "int8":
            contents[graph.file] = to_int8(data, choose, feeds[role])
        else:
            contents[graph.file] = to_half(data, choose)
    return Bundle(
        replace(
            manifest,
            name=f"{manifest.name}-{precision}",
            precision=precision,
            files=hashes(contents),
        ),
        contents,
    )
