"""A real flow network, exported to ONNX, run by ONNX Runtime behind the matcher's interface."""

import cv2
import numpy as np
import pytest
from lucas_kanade_network import HEIGHT, WIDTH, write_bundle
from textured_wall import Wall, exact_flow, texture, turned

from dfvs_core.errors import ImageError
from dfvs_core.matching.classical import classical_matcher
from dfvs_core.messages.network_tensors import FlowOutput
from dfvs_models.bundle import read_bundle
from dfvs_models.catalog import load_matcher
from dfvs_models.onnx_session import Execution, OnnxGraph


@pytest.fixture(scope="module")
def wall():
    return Wall(texture(np.random.default_rng(11), finest_px=6))


@pytest.fixture(scope="module")
def matcher(tmp_path_factory):
    return load_matcher(str(write_bundle(tmp_path_factory.mktemp("bundle"))), threads=1)


def match(matcher, a, b):
    return matcher.match(matcher.encode(a), matcher.encode(b))


def small(picture):
    return cv2.resize(picture, (WIDTH, HEIGHT), interpolation=cv2.INTER_AREA)


def test_a_shift_of_two_pixels_is_found(matcher, wall):
    """Shifted by 4 px at 320 x 240 and halved. Two steps leave a few per cent of the shift."""
    a, b = small(wall.picture()), small(wall.picture(turned(shift=(4.0, -2.0))))
    field = match(matcher, a, b)
    sure = field.confidence > 0.5
    assert sure.mean() > 0.8
    np.testing.assert_allclose(np.median(field.flow[sure], axis=0), [2.0, -1.0], atol=0.1)


def test_pictures_larger_than_the_network_get_flow_in_their_own_pixels(matcher, wall):
    H = turned(roll_deg=1.0, shift=(3.0, -2.0))
    field = match(matcher, wall.picture(), wall.picture(H))
    assert field.flow.shape == (240, 320, 2)
    sure = field.confidence > 0.5
    assert sure.mean() > 0.7
    assert np.median(np.linalg.norm(field.flow - exact_flow(H), axis=-1)[sure]) < 0.3


def test_pictures_of_another_shape_are_scaled_along_each_axis(matcher, wall):
    """A picture 1.5 times as wide has 1.5 times the flow along u, and the same along v."""
    a, b = (cv2.resize(wall.picture(H), (480, 240)) for H in (None, turned(shift=(4.0, 2.0))))
    field = match(matcher, a, b)
    median = np.median(field.flow[field.confidence > 0.5], axis=0)
    np.testing.assert_allclose(median, [6.0, 2.0], atol=0.3)


@pytest.mark.parametrize("layout", ["separate", "channels", "stack"])
@pytest.mark.parametrize("channels", ["rgb", "grey"])
def test_every_layout_gives_the_same_flow(tmp_path, matcher, wall, layout, channels):
    a, b = wall.picture(), wall.picture(turned(shift=(3.0, 1.0)))
    bundle = write_bundle(tmp_path, layout=layout, channels=channels)
    flow = match(load_matcher(str(bundle)), a, b).flow
    # the network's grey is the channels' mean, OpenCV's is weighted
    tolerance = 1e-3 if channels == "rgb" else 0.2
    assert np.median(np.abs(flow - match(matcher, a, b).flow)) < tolerance


@pytest.mark.parametrize(
    "output", [FlowOutput(stride=4), FlowOutput(scale=20.0), FlowOutput(order="vu")], ids=str
)
def test_stride_scale_and_order_of_the_output_are_undone(tmp_path, matcher, wall, output):
    a, b = wall.picture(), wall.picture(turned(shift=(3.0, -1.0)))
    bundle = write_bundle(tmp_path, output=output)
    difference = match(load_matcher(str(bundle)), a, b).flow - match(matcher, a, b).flow
    assert np.median(np.abs(difference)) < 0.1


def test_motion_beyond_the_network_gives_little_confidence(matcher, wall):
    a, b = wall.picture(), wall.picture(turned(shift=(90.0, 50.0)))
    assert match(matcher, a, b).confidence.mean() < 0.1


def test_a_rejected_flow_is_not_found_again(matcher, wall):
    a, b = (matcher.encode(wall.picture(H)) for H in (None, turned(shift=(4.0, -2.0))))
    found = matcher.match(a, b)
    assert np.mean(found.confidence > 0.5) > 0.7
    assert matcher.match(a, b, excluded=[found]).confidence.max() == 0.0


def test_a_hybrid_is_more_precise_and_grows_into_what_the_network_misses(tmp_path, matcher, wall):
    """A motion at the limit of the network: confident on less than a third of the picture."""
    H = turned(roll_deg=6.0, shift=(8.0, 5.0))
    hybrid = load_matcher(f"hybrid:{write_bundle(tmp_path)}", threads=1)
    errors, shares = [], []
    for source in (matcher, hybrid):
        field = match(source, wall.picture(), wall.picture(H))
        sure = field.confidence > 0.5
        errors.append(np.median(np.linalg.norm(field.flow - exact_flow(H), axis=-1)[sure]))
        shares.append(sure.mean())
    assert shares[0] < 0.33
    assert shares[1] > 0.8
    assert errors[1] < 0.3 < errors[0]


def test_a_hybrid_of_what_finds_nothing_finds_nothing(tmp_path, wall):
    hybrid = load_matcher(f"hybrid:{write_bundle(tmp_path)}", threads=1)
    field = match(hybrid, wall.picture(), wall.picture(turned(shift=(90.0, 50.0))))
    assert field.is_finite()
    assert field.confidence.max() == 0.0


def test_plain_pictures_give_no_confidence(matcher):
    plain = np.full((240, 320, 3), 99, np.uint8)
    assert match(matcher, plain, plain).confidence.max() == 0.0


def test_the_same_pictures_give_the_same_bits(matcher, wall):
    a, b = wall.picture(), wall.picture(turned(shift=(3.0, 1.0)))
    first, second = match(matcher, a, b), match(matcher, a, b)
    assert first.flow.tobytes() == second.flow.tobytes()
    assert first.confidence.tobytes() == second.confidence.tobytes()


def test_pictures_prepared_by_the_classical_matcher_are_refused(matcher, wall):
    foreign = classical_matcher().encode(wall.picture())
    with pytest.raises(ImageError, match="another matcher"):
        matcher.match(foreign, foreign)


def test_threads_are_as_asked_and_do_not_spin(tmp_path):
    """Read back from ONNX Runtime itself, which burns a core per thread between frames else."""
    graph = OnnxGraph(read_bundle(write_bundle(tmp_path)), "pair", Execution(threads=3))
    options = graph._session.get_session_options()
    assert options.get_session_config_entry("session.intra_op.allow_spinning") == "0"
    assert options.intra_op_num_threads == 3
    assert options.inter_op_num_threads == 1
