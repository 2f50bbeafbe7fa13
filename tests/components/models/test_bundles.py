"""Bundles that are damaged, hostile or do not fit: each refused with one clear line."""

import contextlib
from pathlib import Path

import grid_network
import numpy as np
import onnx
import pytest
from lucas_kanade_network import HEIGHT, WIDTH, network, write_bundle
from onnx import TensorProto, helper, numpy_helper

from dfvs_core.errors import ModelError
from dfvs_core.messages.manifest import sha256
from dfvs_core.messages.network_tensors import ImageInput
from dfvs_core.messages.schema import dump
from dfvs_models.bundle import read_bundle
from dfvs_models.catalog import (
    bundle_folder,
    load_depth_network,
    load_matcher,
    load_pose,
    model_files,
)
from dfvs_models.onnx_file import check_onnx

SHAPE = (1, 3, HEIGHT, WIDTH)
ENCODED = ["points", "descriptors", "scores"]
PAIR = {"file": "pair.onnx", "inputs": ["x"], "outputs": ["y"]}
DEPTH = {"quantity": "depth", "unit": "relative", "spread": 0.2}


@pytest.fixture
def bundle(tmp_path):
    return write_bundle(tmp_path / "bundle")


def refusal(folder, provider="CPUExecutionProvider"):
    with pytest.raises(ModelError) as caught:
        load_matcher(str(folder), threads=1, provider=provider)
    text = str(caught.value)
    assert "\n" not in text
    return text


def one_node(kind="Add", domain="", inputs=(SHAPE, SHAPE), output=(1, 2, HEIGHT, WIDTH), **extra):
    """A model of a single node; most such models are wrong in some way."""
    names = ("current", "other")
    graph = helper.make_graph(
        [helper.make_node(kind, list(names), ["flow"], domain=domain)],
        "g",
        [
            helper.make_tensor_value_info(n, extra.get("element", TensorProto.FLOAT), s)
            for n, s in zip(names, inputs, strict=True)
        ],
        [helper.make_tensor_value_info("flow", extra.get("element", TensorProto.FLOAT), output)],
    )
    opsets = [helper.make_opsetid("", 17)]
    if domain:
        opsets.append(helper.make_opsetid(domain, 1))
    return helper.make_model(graph, opset_imports=opsets, ir_version=8)


STEAL = one_node("Steal", domain="evil.example")


def test_classical_is_built_in():
    matcher = load_matcher("classical")
    picture = np.random.default_rng(6).integers(0, 256, (HEIGHT, WIDTH, 3), dtype=np.uint8)
    field = matcher.match(matcher.encode(picture), matcher.encode(picture))
    assert np.median(np.abs(field.flow)) < 0.1
    assert model_files("classical") == {}


@pytest.mark.parametrize("prefix", ["", "hybrid:"])
def test_a_model_is_told_by_the_hash_of_every_file(bundle, prefix):
    names = {path.name: sha256(path.read_bytes()) for path in bundle.iterdir()}
    found = model_files(f"{prefix}{bundle}")
    assert set(found) == set(names)
    assert found["pair.onnx"] == names["pair.onnx"]


def test_the_packaged_bundle_goes_by_its_name():
    assert (bundle_folder("dfvs-flow") / "manifest.json").is_file()
    assert load_matcher("dfvs-flow", threads=1) is not None
    assert set(model_files("dfvs-flow")) >= {"manifest.json", "encode.onnx", "match.onnx"}


@pytest.mark.parametrize(
    ("name", "problem"),
    [
        ("hybrid:classical", "names no network"),
        ("hybrid:dfvs-flow", "'encode-match'"),
    ],
)
def test_hybrid_goes_with_the_flow_of_a_pair_network_alone(name, problem):
    with pytest.raises(ModelError, match=f"{problem}.*expected 'hybrid:' and a bundle of the kind"):
        load_matcher(name, threads=1)


def flip_a_bit(bundle):
    data = bytearray((bundle / "pair.onnx").read_bytes())
    data[len(data) // 2] ^= 1
    (bundle / "pair.onnx").write_bytes(data)


def lead_out(bundle):
    outside = (bundle / "pair.onnx").rename(bundle.parent / "elsewhere.onnx")
    (bundle / "pair.onnx").symlink_to(outside)


def spoilt(spoil):
    """A bundle that was spoilt after it was written."""

    def make(folder):
        spoil(write_bundle(folder))
        return folder

    return make


def edited(old, new):
    def edit(bundle):
        manifest = bundle / "manifest.json"
        manifest.write_text(manifest.read_text().replace(old, new))

    return spoilt(edit)


def holding(data):
    """A bundle with another network, which its manifest matches byte for byte."""

    def replace_network(bundle):
        old = (bundle / "pair.onnx").read_bytes()
        (bundle / "pair.onnx").write_bytes(data)
        manifest = bundle / "manifest.json"
        manifest.write_text(manifest.read_text().replace(sha256(old), sha256(data)))

    return spoilt(replace_network)


def of_model(model):
    return holding(model.SerializeToString())


def filled(value):
    """The network with one value for every weight of its filters."""
    model = network()
    for tensor in model.graph.initializer:
        values = numpy_helper.to_array(tensor)
        if values.dtype == np.float32 and values.ndim == 4:
            tensor.CopyFrom(numpy_helper.from_array(np.full_like(values, value), tensor.name))
    return model


def weights_elsewhere():
    model = network()
    tensor = model.graph.initializer[0]
    onnx.external_data_helper.set_external_data(tensor, location="../../etc/passwd")
    tensor.ClearField("raw_data")
    return model


def written(**changes):
    return lambda folder: write_bundle(folder, **changes)


def grid(**changes):
    return lambda folder: grid_network.write_bundle(folder, **changes)


def with_graph(role, **changes):
    """The grid network, one of the graphs of its manifest changed."""
    inputs = [f"{side}_{name}" for side in ("first", "second") for name in ENCODED]
    graphs = {
        "encode": {"file": "encode.onnx", "inputs": ["image"], "outputs": ENCODED},
        "match": {"file": "match.onnx", "inputs": inputs, "outputs": ["partners", "confidence"]},
    }
    return grid(graphs=graphs | {role: graphs[role] | changes})


REFUSED = [
    (lambda folder: folder, ("there is no model", "'classical' or the folder of a bundle")),
    (lambda folder: write_bundle(folder) / "manifest.json", ("is not a folder",)),
    # files that were changed
    (edited('"other"', '"second"'), ("has the inputs ['current', 'other']",)),
    (edited('["flow"]', '["motion"]'), ("lacks the outputs ['motion']",)),
    (spoilt(lambda b: (b / "manifest.json").unlink()), ("lacks the file 'manifest.json'",)),
    (spoilt(lambda b: (b / "manifest.json").write_bytes(b" " * (1024**2 + 1))), ("too large",)),
    (spoilt(lambda b: (b / "pair.onnx").unlink()), ("lacks the file 'pair.onnx'",)),
    (spoilt(flip_a_bit), ("SHA-256",)),
    (spoilt(lead_out), ("leads out of the bundle",)),
    # a manifest that does not fit its network
    (
        written(input=dump(ImageInput(WIDTH // 2, HEIGHT // 2))),
        ("(1, 3, 120, 160)", "(1, 3, 60, 80)"),
    ),
    (written(flow={"stride": 4}), ("(1, 2, 120, 160); expected float32 of (1, 2, 30, 40)",)),
    (
        written(kind="mono", graphs={"mono": PAIR}, flow=None, depth=DEPTH),
        ("kind 'mono', which gives depth",),
    ),
    (
        written(kind="encode-match", graphs={"encode": PAIR, "match": PAIR}, flow=None),
        ("has the inputs",),
    ),
    # networks that cannot be run, or not trusted
    (
        of_model(one_node(inputs=(("N", 3, HEIGHT, WIDTH), SHAPE), output=SHAPE)),
        ("fixed sizes",),
    ),
    (of_model(one_node(output=SHAPE, element=TensorProto.DOUBLE)), ("tensor(double)",)),
    (of_model(filled(np.nan)), ("not numbers",)),
    (of_model(filled(np.inf)), ("not finite",)),
    (of_model(STEAL), ("'Steal' of the domain 'evil.example'",)),
    (of_model(weights_elsewhere()), ("keeps weights in another file",)),
    (holding(b""), ("pair.onnx",)),
    (holding(b"\xff" * 40), ("pair.onnx",)),
    (holding(b"garbage that is no protocol buffer"), ("pair.onnx",)),
    # two graphs whose tensors are not as announced
    (with_graph("encode", inputs=["picture"]), ("'encode.onnx' has the inputs ['image']",)),
    (with_graph("encode", outputs=ENCODED[:2]), ("expected 3 of them",)),
    (
        with_graph("encode", outputs=["points", "colours", "scores"]),
        ("lacks the outputs ['colours']",),
    ),
    (
        with_graph("match", inputs=["first_points"]),
        ("'match.onnx' has the inputs ['first_points', ",),
    ),
    (with_graph("match", outputs=["partners"]), ("expected 2 of them",)),
    (
        with_graph("match", outputs=["partners", "certainty"]),
        ("lacks the outputs ['certainty']",),
    ),
    (
        grid(input=dump(ImageInput(grid_network.WIDTH // 2, grid_network.HEIGHT, channels="grey"))),
        ("takes [('tensor(float)', (1, 1, 64, 96))]", "expected tensor(float) of (1, 1, 64, 48)"),
    ),
    (
        grid(match=grid_network.match_model(sizes=(1, grid_network.COUNT))),
        (
            "graph 'match' takes [(24, 2)",
            "of any number of keypoints (0): [(0, 2)",
        ),
    ),
    (
        grid(match=grid_network.match_model(channels=grid_network.CHANNELS + 1)),
        (
            "graph 'match' takes [(0, 2), (0, 3)",
            "of any number of keypoints (0): [(0, 2), (0, 2)",
        ),
    ),
    # output that is found wrong when the network runs for the first time
    (
        grid(match=grid_network.match_model(width=4)),
        ("'partners' of 'match.onnx' is float32 of (1, 1, 4)", "expected float32 of (1, 1, 2)"),
    ),
    (grid(encode=grid_network.encode_model(gain=0.0)), ("graph 'encode' finds no keypoint",)),
    (grid(encode=grid_network.encode_model(offset=np.nan)), ("not numbers",)),
    (grid(encode=grid_network.encode_model(offset=np.inf)), ("not finite",)),
]


@pytest.mark.parametrize(("make", "said"), REFUSED, ids=[said[0] for _, said in REFUSED])
def test_a_bundle_that_is_damaged_or_hostile_or_does_not_fit_is_refused(tmp_path, make, said):
    text = refusal(make(tmp_path / "bundle"))
    assert [words for words in said if words not in text] == []


@pytest.mark.parametrize("provider", ["Azure", "CUDA", "Tensorrt"])
@pytest.mark.parametrize("model", ["dfvs-flow", "classical"])  # which needs none
def test_a_provider_that_is_not_there_is_refused_with_the_way_to_another_build(model, provider):
    text = refusal(model, provider=f"{provider}ExecutionProvider")
    assert f"no provider '{provider}ExecutionProvider'" in text
    assert "CPUExecutionProvider" in text
    assert "--force-reinstall" in text  # without it pip leaves out what it believes to be there


def model_of(*nodes, weights=()):
    graph = helper.make_graph(list(nodes), "g", [], [], list(weights))
    return helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)])


def constant(**value):
    return model_of(helper.make_node("Constant", [], ["w"], **value))


def in_numbers(element):
    """Weights, one of them not a number, in the notation that takes one number a field."""
    values = np.array([1.0, np.nan, 2.0], element)
    kind = helper.np_dtype_to_tensor_dtype(values.dtype)
    return model_of(weights=[helper.make_tensor("w", kind, values.shape, values)])


def in_bytes(element):
    return model_of(weights=[numpy_helper.from_array(np.array([1.0, np.nan, 2.0], element), "w")])


def elsewhere():
    tensor = numpy_helper.from_array(np.zeros(4, np.float32), "w")
    onnx.external_data_helper.set_external_data(tensor, location="weights.bin")
    return tensor


BRANCH = helper.make_node("If", ["c"], ["flow"], then_branch=STEAL.graph, else_branch=STEAL.graph)


@pytest.mark.parametrize(
    ("model", "words"),
    [
        *((in_bytes(e), "not numbers") for e in (np.float16, np.float32, np.float64)),
        *((in_numbers(e), "not numbers") for e in (np.float16, np.float32, np.float64)),
        (constant(value_float=float("nan")), "not numbers"),
        (constant(value_float=float("-inf")), None),
        (constant(value=elsewhere()), "another file"),
        (model_of(BRANCH), "Steal"),
    ],
)
def test_what_a_file_may_not_hold_is_found_wherever_it_stands(model, words):
    with contextlib.nullcontext() if words is None else pytest.raises(ModelError, match=words):
        check_onnx(model.SerializeToString(), "net.onnx")


def test_a_field_whose_number_other_readers_cut_down_hides_nothing():
    graph = STEAL.graph.SerializeToString()
    key, shifts = (7 << 3 | 2) + (1 << 32), range(0, 35, 7)
    tag = bytes((key >> shift & 0x7F) | (0x80 if shift < 28 else 0) for shift in shifts)
    hidden = model_of().SerializeToString() + tag + _varint(len(graph)) + graph
    with pytest.raises(ModelError, match="field number"):
        check_onnx(hidden, "net.onnx")


def _varint(value):
    digits = []
    while value > 0x7F:
        digits.append(value & 0x7F | 0x80)
        value >>= 7
    return bytes([*digits, value])


def test_a_network_cut_short_anywhere_never_crashes_the_check():
    data = network().SerializeToString()
    for length in range(1, len(data), max(1, len(data) // 200)):
        with contextlib.suppress(ModelError):
            check_onnx(data[:length], "net.onnx")


def test_the_bytes_that_were_verified_are_the_bytes_that_are_kept(bundle):
    before = (bundle / "pair.onnx").read_bytes()
    read = read_bundle(bundle)
    (bundle / "pair.onnx").write_bytes(b"swapped afterwards")
    assert read.graph("pair") == before


def test_a_path_object_is_the_folder_of_a_matcher(bundle, monkeypatch):
    monkeypatch.chdir(bundle.parent)
    assert load_matcher(Path(bundle.name), threads=1)


@pytest.mark.parametrize("load", [load_matcher, load_depth_network, load_pose])
def test_a_path_object_is_never_the_name_of_a_bundle_in_this_package(load, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ModelError, match="there is no model"):
        load(Path("dfvs-flow"))
