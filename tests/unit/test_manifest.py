"""The model contract: what a manifest must say, and what it must not."""

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dfvs_core.errors import ModelError
from dfvs_core.messages.manifest import Graph, Manifest, check_files, sha256
from dfvs_core.messages.network_tensors import DepthOutput, FlowOutput, ImageInput, PoseOutput

ONNX = b"not really a network"


def manifest(**changes):
    fields = {
        "format": "dfvs-bundle/2",
        "name": "tiny",
        "kind": "pair",
        "input": ImageInput(64, 48),
        "graphs": {"pair": Graph("net.onnx", ("a", "b"), ("flow",))},
        "files": {"net.onnx": sha256(ONNX)},
        "licence": "Apache-2.0",
        "origin": "made by a test",
        "flow": FlowOutput(stride=8),
        "accuracy": {"small_epe_px": 0.8},
    }
    return Manifest(**(fields | changes))


def document(**changes):
    return json.loads(manifest().to_json()) | changes


def test_a_manifest_survives_the_way_to_json_and_back():
    assert Manifest.from_json(manifest().to_json().encode()) == manifest()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"format": "dfvs-bundle/1"}, "format 'dfvs-bundle/1'; expected 'dfvs-bundle/2'"),
        ({"kind": "triple"}, "kind = 'triple'"),
        ({"licence": 7}, "licence = 7"),
        ({"lisence": "MIT"}, "did you mean 'licence'"),
        ({"files": {"net.onnx": "abc"}}, "64 hexadecimal"),
        ({"files": {}}, "'net.onnx'; expected a file listed in 'files'"),
        ({"graphs": {}}, r"has the graphs \[\]"),
        ({"flow": None}, "lacks 'flow'"),
        ({"flow": {"stride": 7}}, "flow stride 7"),
        ({"flow": {"scale": 0.0}}, "scale is 0"),
        ({"input": {"width": 60, "height": 48, "multiple_of": 8}}, "multiples of 8"),
        ({"input": {"layout": "stack"}}, "2 inputs and 1 outputs; expected 1 and 1"),
        ({"input": {"mean": [0.5, 0.5]}}, "mean has 2 values; expected 1 or 3"),
        ({"input": {"std": [0.0]}}, "positive"),
        ({"input": {"width": 9000}}, "out of range"),
    ],
)
def test_a_manifest_that_contradicts_itself_is_refused(changes, message):
    with pytest.raises(ModelError, match=message):
        Manifest.from_json(json.dumps(document(**changes)).encode())


@pytest.mark.parametrize(
    "name", ["../net.onnx", "/etc/passwd", "sub/net.onnx", "..", ".hidden", "a\\b", "a\nb", ""]
)
def test_names_that_could_lead_out_of_the_folder_are_refused(name):
    changed = document(files={name: "0" * 64})
    with pytest.raises(ModelError, match="a plain name without folders"):
        Manifest.from_json(json.dumps(changed).encode())


@pytest.mark.parametrize(
    ("data", "message"),
    [
        *((data, "is not JSON") for data in (b"", b"{", b"\0\1 no", b"\xff\xfe\0", b"[" * 100_000)),
        (b"[]", "manifest: "),
    ],
    ids=["empty", "cut", "bytes", "no UTF-8", "deep", "a list"],
)
def test_what_is_no_json_object_is_refused(data, message):
    with pytest.raises(ModelError, match=message):
        Manifest.from_json(data)


SPARSE = [("encode-match", ("encode", "match")), ("mono", ("mono",)), ("pose", ("pose",))]


@pytest.mark.parametrize(("kind", "roles"), SPARSE)
def test_kinds_without_flow_can_be_read(kind, roles):
    names = (("a", "b", "f"), ("t", "r")) if kind == "pose" else (("x",), ("y",))
    graphs = {role: Graph("net.onnx", *names) for role in roles}
    depth = DepthOutput("depth", "relative", spread=0.2) if kind == "mono" else None
    pose = PoseOutput("m", "vector") if kind == "pose" else None
    made = manifest(kind=kind, graphs=graphs, flow=None, depth=depth, pose=pose)
    assert Manifest.from_json(made.to_json().encode()) == made


@pytest.mark.parametrize(("kind", "roles"), SPARSE)
def test_flow_is_announced_by_networks_that_give_it_and_no_others(kind, roles):
    graphs = {role: Graph("net.onnx", ("x",), ("y",)) for role in roles}
    with pytest.raises(ModelError, match=f"'{kind}' bundle has 'flow'"):
        manifest(kind=kind, graphs=graphs)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"depth": None}, "lacks 'depth'"),
        ({"kind": "pair"}, "has the graphs"),
        ({"depth": {"quantity": "depth"}}, "depth.unit"),
        ({"depth": {"quantity": "disparity", "unit": "m"}}, "depth.quantity = 'disparity'"),
        ({"depth": {"quantity": "depth", "unit": "mm"}}, "depth.unit = 'mm'"),
        ({"depth": {"quantity": "depth", "unit": "1/m"}}, "depth in the unit '1/m'"),
        ({"depth": {"quantity": "depth", "unit": "affine"}}, "depth in the unit 'affine'"),
        ({"depth": {"quantity": "depth", "unit": "m"}}, "without 'scale_spread'"),
        ({"depth": {"quantity": "depth", "unit": "relative", "scale_spread": 0.1}}, "with 'scale"),
        ({"depth": {"quantity": "depth", "unit": "relative"}}, "no 'spread'"),
        ({"depth": {"quantity": "depth", "unit": "relative", "spread": 0.0}}, "depth.spread"),
        (
            {"depth": {"quantity": "depth", "unit": "relative", "spread": 1, "stride": 5}},
            "stride 5",
        ),
        ({"input": {"width": 63, "height": 48}}, "depth stride 2"),
    ],
)
def test_a_manifest_of_a_depth_network_that_contradicts_itself_is_refused(changes, message):
    graphs = {"mono": Graph("net.onnx", ("image",), ("z",))}
    depth = DepthOutput("depth", "relative", stride=2, spread=0.2)
    made = json.loads(manifest(kind="mono", graphs=graphs, flow=None, depth=depth).to_json())
    with pytest.raises(ModelError, match=message):
        Manifest.from_json(json.dumps(made | changes).encode())


SPREADS = st.one_of(st.none(), st.floats(-1.0, 12.0))


@given(
    quantity=st.sampled_from(["depth", "inverse-depth"]),
    unit=st.sampled_from(["m", "1/m", "relative", "affine"]),
    stride=st.integers(-1, 70),
    spreads=st.tuples(SPREADS, SPREADS),
    counts=st.tuples(st.integers(0, 3), st.integers(0, 3)),
)
def test_a_depth_manifest_is_read_as_it_was_written_or_refused(
    quantity, unit, stride, spreads, counts
):
    """And what is read tells what perception needs: a unit that fits, and how sure the depth is."""
    names = [tuple("abc"[:count]) for count in counts]
    spread, scale_spread = spreads
    output = {"quantity": quantity, "unit": unit, "stride": stride}
    output |= {"spread": spread, "scale_spread": scale_spread}
    graph = {"file": "net.onnx", "inputs": names[0], "outputs": names[1]}
    made = document(kind="mono", flow=None, depth=output, graphs={"mono": graph})
    try:
        read = Manifest.from_json(json.dumps(made).encode())
    except ModelError:
        return
    assert Manifest.from_json(read.to_json().encode()) == read
    assert read.depth is not None
    assert (unit, quantity) not in {("m", "inverse-depth"), ("1/m", "depth"), ("affine", "depth")}
    assert (scale_spread is not None) == (unit in ("m", "1/m"))
    assert (spread is not None) == (counts[1] == 1)
    assert 64 % stride == 48 % stride == 0


ENCODED = ("points", "scores")


def two_graphs(*inputs):
    graphs = {
        "encode": Graph("net.onnx", ("image",), ENCODED),
        "match": Graph("net.onnx", inputs, ("partners",)),
    }
    return manifest(kind="encode-match", graphs=graphs, flow=None)


def test_what_goes_into_the_match_is_found_by_name():
    made = two_graphs("second_points", "first_points", "first_scores")
    feeds = made.match_feeds(("here", "one"), ("there", "two"))
    assert list(feeds.items()) == [
        ("second_points", "there"),
        ("first_points", "here"),
        ("first_scores", "one"),
    ]


def test_a_match_that_takes_what_no_encoder_gives_is_refused():
    with pytest.raises(ModelError, match="third_points"):
        two_graphs("first_points", "third_points").match_feeds((1, 2), (3, 4))


@pytest.mark.parametrize(
    ("layout", "channels", "shapes"),
    [
        ("separate", "rgb", ((1, 3, 48, 64), (1, 3, 48, 64))),
        ("channels", "rgb", ((1, 6, 48, 64),)),
        ("stack", "grey", ((1, 2, 1, 48, 64),)),
    ],
)
def test_the_layout_fixes_the_shapes_of_the_inputs(layout, channels, shapes):
    assert ImageInput(64, 48, layout=layout, channels=channels).pair_shapes() == shapes


def test_files_that_are_as_announced_are_accepted():
    check_files(manifest(), {"net.onnx": ONNX})


@pytest.mark.parametrize(
    ("contents", "message"),
    [
        ({}, "lacks the file 'net.onnx'"),
        ({"net.onnx": ONNX[:-1] + b"!"}, "SHA-256"),
        ({"net.onnx": b""}, "SHA-256"),
        ({"net.onnx": ONNX, "more.bin": b""}, "does not list"),
    ],
    ids=["missing", "one byte changed", "empty", "not announced"],
)
def test_files_that_differ_from_the_manifest_are_refused(contents, message):
    with pytest.raises(ModelError, match=message):
        check_files(manifest(), contents)
