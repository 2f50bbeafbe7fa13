"""What a time of ``dfvs-export bench`` is of."""

import depth_bundle
import lucas_kanade_network
import numpy as np
import onnx_network
import pytest

from dfvs_export.bundles.runner import BundleRunner
from dfvs_export.checks.timing import run_frame
from dfvs_models.bundle import read_bundle


class CountedRunner(BundleRunner):
    """Counts the runs of the last graph."""

    runs = 0

    def match(self, first, second):
        self.runs += 1
        return super().match(first, second)


def depth_folder(folder):
    return onnx_network.write_bundle(folder, depth_bundle.bundle(np.full((24, 32), 0.5)))


@pytest.mark.parametrize(
    ("write", "runs"), [(lucas_kanade_network.write_bundle, 2), (depth_folder, 1)]
)
def test_a_pair_network_is_run_both_ways_for_a_frame_as_every_match_does(write, runs, tmp_path):
    runner = CountedRunner(read_bundle(write(tmp_path)), 1)
    image = np.full((120, 160, 3), 90, np.uint8)
    run_frame(runner, image, runner.encode(image))
    assert runner.runs == runs
