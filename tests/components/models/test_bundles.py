"""Bundles that are damaged, hostile or do not fit: each refused with one clear line."""

import contextlib

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
from dfvs_models.catalog import bundle_folder, load_matcher, model_files
from dfvs_models.onnx_file import check_onnx

SHAPE = (1, 3, HEIGHT, WIDTH)


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


def replace_network(folder, data):
    """Put another network into a bundle, whose manifest then matches it byte for byte."""
    old = (folder / "pair.onnx").read_bytes()
    (folder / "pair.onnx").write_bytes(data)
    manifest = folder / "manifest.json"
    manifest.write_text(manifest.read_text().replace(sha256(old), sha256(data)))
    return folder


def rewrite(folder, model):
    return replace_network(folder, model.SerializeToString())


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


def edited(bundle, old, new):
    manifest = bundle / "manifest.json"
    manifest.write_text(manifest.read_text().replace(old, new))


def flip_a_bit(bundle):
    data = bytearray((bundle / "pair.onnx").read_bytes())
    data[len(data) // 2] ^= 1
    (bundle / "pair.onnx").write_bytes(data)


def lead_out(bundle):
    outside = (bundle / "pair.onnx").rename(bundle.parent / "elsewhere.onnx")
    (bundle / "pair.onnx").symlink_to(outside)


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (
            lambda b: edited(b, "dfvs-bundle/2", "dfvs-bundle/1"),
            "format 'dfvs-bundle/1'; expected 'dfvs-bundle/2'",
        ),
        (lambda b: edited(b, '"pair.onnx"', '"../pair.onnx"'), "a plain name without folders"),
        (lambda b: edited(b, '"other"', '"second"'), "has the inputs ['current', 'other']"),
        (lambda b: edited(b, '["flow"]', '["motion"]'), "one named 'motion'"),
        (lambda b: (b / "manifest.json").unlink(), "lacks the file 'manifest.json'"),
        (lambda b: (b / "manifest.json").write_bytes(b"\0\1 no"), "the manifest is not JSON"),
        (lambda b: (b / "manifest.json").write_bytes(b" " * (1024 * 1024 + 1)), "too large"),
        (lambda b: (b / "pair.onnx").unlink(), "lacks the file 'pair.onnx'"),
        (flip_a_bit, "SHA-256"),
        (lead_out, "leads out of the bundle"),
    ],
)
def test_a_bundle_that_was_spoilt_is_refused(bundle, spoil, said):
    spoil(bundle)
    assert said in refusal(bundle)


def test_an_unknown_name_is_answered_with_what_there_is(tmp_path):
    text = refusal(tmp_path / "clasical")
    assert "there is no model" in text
    assert "'classical' or the folder of a bundle" in text


def test_a_file_is_no_bundle(bundle):
    assert "is not a folder" in refusal(bundle / "manifest.json")


def test_a_network_of_another_size_than_declared_is_refused(tmp_path):
    other = dump(ImageInput(WIDTH // 2, HEIGHT // 2))
    text = refusal(write_bundle(tmp_path / "b", input=other))
    assert "(1, 3, 120, 160)" in text
    assert "(1, 3, 60, 80)" in text


def test_an_output_of_another_shape_than_declared_is_refused(tmp_path):
    text = refusal(write_bundle(tmp_path / "b", flow={"stride": 4}))
    assert "(1, 2, 120, 160); expected float32 of (1, 2, 30, 40)" in text


def test_dynamic_shapes_are_refused(bundle):
    dynamic = one_node(inputs=(("N", 3, HEIGHT, WIDTH), SHAPE), output=SHAPE)
    assert "fixed sizes" in refusal(rewrite(bundle, dynamic))


def test_other_element_types_are_refused(bundle):
    doubles = one_node(output=SHAPE, element=TensorProto.DOUBLE)
    assert "tensor(double)" in refusal(rewrite(bundle, doubles))


@pytest.mark.parametrize(("value", "words"), [(np.nan, "not numbers"), (np.inf, "not finite")])
def test_weights_that_are_not_finite_are_noticed_at_the_start(bundle, value, words):
    model = network()
    for tensor in model.graph.initializer:
        values = numpy_helper.to_array(tensor)
        if values.dtype == np.float32 and values.ndim == 4:
            tensor.CopyFrom(numpy_helper.from_array(np.full_like(values, value), tensor.name))
    assert words in refusal(rewrite(bundle, model))


@pytest.mark.parametrize("element", [np.float16, np.float32, np.float64])
@pytest.mark.parametrize("raw", [True, False])
def test_weights_that_are_not_numbers_are_found_in_every_notation(element, raw):
    values = np.array([1.0, np.nan, 2.0], element)
    tensor = numpy_helper.from_array(values, "w")
    if not raw:
        kind = helper.np_dtype_to_tensor_dtype(values.dtype)
        tensor = helper.make_tensor("w", kind, values.shape, values)
    model = helper.make_model(helper.make_graph([], "g", [], [], [tensor]))
    with pytest.raises(ModelError, match="not numbers"):
        check_onnx(model.SerializeToString(), "net.onnx")


def test_a_constant_that_is_not_a_number_is_found():
    node = helper.make_node("Constant", [], ["w"], value_float=float("nan"))
    model = helper.make_model(helper.make_graph([node], "g", [], []))
    with pytest.raises(ModelError, match="not numbers"):
        check_onnx(model.SerializeToString(), "net.onnx")


def test_infinite_constants_are_numbers():
    node = helper.make_node("Constant", [], ["w"], value_float=float("-inf"))
    check_onnx(
        helper.make_model(helper.make_graph([node], "g", [], [])).SerializeToString(), "net.onnx"
    )


def test_a_field_whose_number_other_readers_cut_down_hides_nothing():
    graph = one_node("Steal", domain="evil.example").graph.SerializeToString()
    key, shifts = (7 << 3 | 2) + (1 << 32), range(0, 35, 7)
    tag = bytes((key >> shift & 0x7F) | (0x80 if shift < 28 else 0) for shift in shifts)
    plain = helper.make_model(helper.make_graph([], "g", [], [])).SerializeToString()
    hidden = plain + tag + _varint(len(graph)) + graph
    with pytest.raises(ModelError, match="field number"):
        check_onnx(hidden, "net.onnx")


def _varint(value):
    digits = []
    while value > 0x7F:
        digits.append(value & 0x7F | 0x80)
        value >>= 7
    return bytes([*digits, value])


def test_custom_operators_are_refused(bundle):
    custom = one_node("Steal", domain="evil.example")
    text = refusal(rewrite(bundle, custom))
    assert "'Steal' of the domain 'evil.example'" in text


def test_custom_operators_in_a_branch_are_found():
    inner = one_node("Steal", domain="evil.example").graph
    branch = helper.make_node("If", ["c"], ["flow"], then_branch=inner, else_branch=inner)
    outer = helper.make_graph([branch], "outer", [], [])
    model = helper.make_model(outer, opset_imports=[helper.make_opsetid("", 17)])
    with pytest.raises(ModelError, match="Steal"):
        check_onnx(model.SerializeToString(), "net.onnx")


def test_weights_outside_the_file_are_refused(bundle):
    model = network()
    tensor = model.graph.initializer[0]
    onnx.external_data_helper.set_external_data(tensor, location="../../etc/passwd")
    tensor.ClearField("raw_data")
    assert "keeps weights in another file" in refusal(rewrite(bundle, model))


def test_external_weights_in_an_attribute_are_found():
    tensor = numpy_helper.from_array(np.zeros(4, np.float32), "w")
    onnx.external_data_helper.set_external_data(tensor, location="weights.bin")
    node = helper.make_node("Constant", [], ["w"], value=tensor)
    model = helper.make_model(helper.make_graph([node], "g", [], []))
    with pytest.raises(ModelError, match="another file"):
        check_onnx(model.SerializeToString(), "net.onnx")


@pytest.mark.parametrize("data", [b"", b"\xff" * 40, b"garbage that is no protocol buffer"])
def test_files_that_are_no_networks_are_refused(bundle, data):
    assert "pair.onnx" in refusal(replace_network(bundle, data))


def test_a_network_cut_short_anywhere_never_crashes_the_check():
    data = network().SerializeToString()
    for length in range(1, len(data), max(1, len(data) // 200)):
        with contextlib.suppress(ModelError):
            check_onnx(data[:length], "net.onnx")


def test_a_provider_that_is_not_there_is_refused_by_name(bundle):
    assert "no provider 'Azure" in refusal(bundle, provider="AzureExecutionProvider")
    text = refusal(bundle, provider="CUDAExecutionProvider")
    assert "no provider 'CUDAExecutionProvider'" in text
    assert "CPUExecutionProvider" in text


def test_a_provider_that_is_not_there_is_refused_where_none_is_needed():
    assert "no provider 'TensorrtExecutionProvider'" in refusal(
        "classical", provider="TensorrtExecutionProvider"
    )


def test_a_network_that_gives_depth_is_no_matcher(tmp_path):
    graph = {"file": "pair.onnx", "inputs": ["x"], "outputs": ["y"]}
    depth = {"quantity": "depth", "unit": "relative", "spread": 0.2}
    changes = {"kind": "mono", "graphs": {"mono": graph}, "flow": None, "depth": depth}
    text = refusal(write_bundle(tmp_path / "b", **changes))
    assert "kind 'mono', which gives depth" in text


def test_graphs_that_are_not_what_an_encode_match_manifest_says_are_refused(tmp_path):
    graph = {"file": "pair.onnx", "inputs": ["x"], "outputs": ["y"]}
    graphs = dict.fromkeys(("encode", "match"), graph)
    text = refusal(write_bundle(tmp_path / "b", kind="encode-match", graphs=graphs, flow=None))
    assert "has the inputs" in text


def with_graph(role, **changes):
    """Graphs of the grid network's manifest, one of them changed."""
    inputs = [f"{side}_{name}" for side in ("first", "second") for name in grid_network.ENCODED]
    graphs = {
        "encode": {
            "file": "encode.onnx",
            "inputs": ["image"],
            "outputs": list(grid_network.ENCODED),
        },
        "match": {"file": "match.onnx", "inputs": inputs, "outputs": list(grid_network.MATCHED)},
    }
    graphs[role] |= changes
    return graphs


@pytest.mark.parametrize(
    ("role", "changes", "words"),
    [
        ("encode", {"inputs": ["picture"]}, "'encode.onnx' has the inputs ['image']"),
        ("encode", {"outputs": ["points", "descriptors"]}, "expected 3 of them"),
        ("encode", {"outputs": ["points", "colours", "scores"]}, "lacks the outputs ['colours']"),
        ("match", {"inputs": ["first_points"]}, "'match.onnx' has the inputs ['first_points', "),
        ("match", {"outputs": ["partners"]}, "expected 2 of them"),
        ("match", {"outputs": ["partners", "certainty"]}, "lacks the outputs ['certainty']"),
    ],
)
def test_tensors_of_two_graphs_that_are_not_as_announced_are_refused(
    tmp_path, role, changes, words
):
    assert words in refusal(grid_network.write_bundle(tmp_path, graphs=with_graph(role, **changes)))


def test_an_encoder_for_images_of_another_size_than_declared_is_refused(tmp_path):
    size = dump(ImageInput(grid_network.WIDTH // 2, grid_network.HEIGHT, channels="grey"))
    text = refusal(grid_network.write_bundle(tmp_path, input=size))
    assert "takes [('tensor(float)', (1, 1, 64, 96))]" in text
    assert "expected tensor(float) of (1, 1, 64, 48)" in text


def test_a_matcher_of_a_fixed_number_of_images_and_keypoints_is_refused(tmp_path):
    match = grid_network.match_model(sizes=(1, grid_network.COUNT))
    text = refusal(grid_network.write_bundle(tmp_path, match=match))
    assert "graph 'match' takes [(1, 24, 2)" in text
    assert "of any number of images and keypoints (0): [(0, 0, 2)" in text


def test_a_matcher_of_other_descriptors_than_its_encoders_is_refused(tmp_path):
    match = grid_network.match_model(channels=grid_network.CHANNELS + 1)
    text = refusal(grid_network.write_bundle(tmp_path, match=match))
    assert "graph 'match' takes [(0, 0, 2), (0, 0, 3)" in text
    assert "of any number of images and keypoints (0): [(0, 0, 2), (0, 0, 2)" in text


def test_partners_that_are_no_points_are_refused(tmp_path):
    text = refusal(grid_network.write_bundle(tmp_path, match=grid_network.match_model(width=4)))
    assert "graph 'match' gives (2, 24, 4)" in text
    assert "expected (2, 24, 2)" in text


@pytest.mark.parametrize(("offset", "words"), [(np.nan, "not numbers"), (np.inf, "not finite")])
def test_keypoints_that_are_not_finite_are_noticed_at_the_start(tmp_path, offset, words):
    encode = grid_network.encode_model(offset=offset)
    assert words in refusal(grid_network.write_bundle(tmp_path, encode=encode))


def test_the_bytes_that_were_verified_are_the_bytes_that_are_kept(bundle):
    before = (bundle / "pair.onnx").read_bytes()
    read = read_bundle(bundle)
    (bundle / "pair.onnx").write_bytes(b"swapped afterwards")
    assert read.graph("pair") == before
