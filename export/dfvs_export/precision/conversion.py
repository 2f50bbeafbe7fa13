"""A bundle's graphs with fewer bits."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

from dfvs_export.bundles.bundle import hashes
from dfvs_export.bundles.runner import BundleRunner, ImagePair
from dfvs_export.precision.calibration import graph_feeds
from dfvs_export.precision.half import to_half
from dfvs_export.precision.int8 import to_int8
from dfvs_models.bundle import Bundle


def in_precision(
    bundle: Bundle, precision: Literal["fp16", "int8"], frames: Sequence[ImagePair]
) -> Bundle:
    """Return the bundle, which is in fp32, with its heavy operators in another precision.

    ``frames`` are images of the bundle's size, to calibrate int8 on.
    """
    feeds = graph_feeds(BundleRunner(bundle), frames) if precision == "int8" else {}
    manifest, contents = bundle.manifest, dict(bundle.contents)
    for role, graph in manifest.graphs.items():
        data, takes_images = contents[graph.file], role != "match"
        if precision == "int8":
            contents[graph.file] = to_int8(data, takes_images, feeds[role])
        else:
            contents[graph.file] = to_half(data, takes_images)
    return Bundle(
        replace(
            manifest,
            name=f"{manifest.name}-{precision}",
            precision=precision,
            files=hashes(contents),
        ),
        contents,
    )
