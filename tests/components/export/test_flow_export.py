from __future__ import annotations

import importlib
import json
import math
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest

torch = pytest.importorskip("torch")

import onnx  # noqa: E402

from dfvs_core.errors import ModelError  # noqa: E402
from dfvs_core.matching.hybrid import HybridMatcher  # noqa: E402
from dfvs_export.check import drawn_pairs, operators, parity  # noqa: E402
from dfvs_export.cli import main  # noqa: E402
from dfvs_export.networks.dfvs_flow import DfvsFlow  # noqa: E402
from dfvs_export.own import SHIPPED, OwnFlow  # noqa: E402
from dfvs_export.running import FlowRunner  # noqa: E402
from dfvs_export.train.checkpoint import (  # noqa: E402
    Checkpoint,
    load_checkpoint,
    save_checkpoint,
)
from dfvs_models.bundle import read_bundle  # noqa: E402
from dfvs_models.catalog import bundle_folder, load_matcher  # noqa: E402

SIZE = (96, 64)
ALLOWED = {"GridSample", "ArgMax", "Conv", "MatMul", "Softmax", "Gather"}
FORBIDDEN = {"Loop", "If", "Scan", "NonZero", "ScatterND"}


@pytest.fixture(scope="module")
def checkpoint(tmp_path_factory) -> Path:
    torch.manual_seed(3)
    network = DfvsFlow().eval()
    with torch.no_grad():  # as sharp as trained ones become: what overflows shows up
        network.log_scale.fill_(math.log(40.0))
        network.log_scale4.fill_(math.log(40.0))
    state = network.state_dict()
    path = tmp_path_factory.mktemp("weights") / "random.pt"
    origin = {"settings": {"size": SIZE, "steps": 0, "minutes": 1.0, "pairs_per_step": 1}}
    origin["settings"] |= {"learning_rate": 1e-3, "precision": "fp32", "seed": 0}
    save_checkpoint(path, Checkpoint(state, state, {}, 0, (origin,), network.architecture))
    return path


@pytest.fixture(scope="module")
def bundle(checkpoint, tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("bundles") / "dfvs-flow"
    arguments = ["flow", "--checkpoint", str(checkpoint), "--size", "96x64", "--out", str(out)]
    assert main(arguments) == 0
    return out


def test_a_bundle_says_what_it_holds(bundle: Path) -> None:
    read = read_bundle(bundle)
    manifest, contents = read.manifest, read.contents
    assert manifest.kind == "encode-match"
    assert (manifest.input.width, manifest.input.height) == SIZE
    assert set(contents) == {"encode.onnx", "match.onnx", "MODEL_CARD.md"}
    assert b"Not measured" in contents["MODEL_CARD.md"]


def test_torch_and_onnx_runtime_agree_on_random_weights(bundle: Path, checkpoint: Path) -> None:
    runner = FlowRunner(read_bundle(bundle))
    found = parity(OwnFlow.load(checkpoint), runner, drawn_pairs(SIZE, 3, 11))
    # the limit that every bundle has to keep; random weights make large and wild flow
    assert found.mean_px < 1e-3


def test_a_bundle_that_works_at_a_smaller_size_gives_flow_of_the_pictures_own(
    checkpoint: Path, tmp_path: Path, capsys
) -> None:
    out = tmp_path / "smaller"
    arguments = ["flow", "--checkpoint", str(checkpoint), "--size", "160x112", "--out", str(out)]
    assert main([*arguments, "--working-size", "96x64"]) == 0
    manifest = read_bundle(out).manifest
    assert (manifest.input.width, manifest.input.height) == (160, 112)
    assert manifest.working_size == (96, 64)
    assert b"works at 96 x 64" in read_bundle(out).contents["MODEL_CARD.md"]
    capsys.readouterr()
    main(["check", str(out), "--checkpoint", str(checkpoint), "--count", "2", "--json"])
    assert json.loads(capsys.readouterr().out)["mean_difference_px"] < 1e-3
    matcher = load_matcher(f"alone:{out}")
    first, second = drawn_pairs((160, 112), 1, 14)[0]
    field = matcher.match(matcher.prepare(first), matcher.prepare(second))
    assert field.flow.shape == (112, 160, 2)
    assert field.confidence.shape == (112, 160)


def test_the_shipped_weights_give_bundles_of_any_size_that_check_compares(
    tmp_path: Path, capsys
) -> None:
    out = tmp_path / "small"
    assert main(["flow", "--model", "dfvs-flow", "--size", "160x112", "--out", str(out)]) == 0
    shipped = read_bundle(bundle_folder("dfvs-flow")).manifest
    assert read_bundle(out).manifest.origin == shipped.origin
    steps = load_checkpoint(SHIPPED).step
    assert f"{steps} steps" in (out / "MODEL_CARD.md").read_text()
    capsys.readouterr()
    assert main(["check", str(out), "--count", "2", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["greatest_trusted_difference_px"] < 1e-3


def test_the_shipped_bundle_holds_the_shipped_weights(capsys) -> None:
    assert main(["check", "dfvs-flow", "--count", "4", "--json"]) == 0  # the first shows nothing
    assert json.loads(capsys.readouterr().out)["greatest_trusted_difference_px"] < 1e-3


def test_weights_that_nobody_named_are_not_compared(bundle: Path, capsys) -> None:
    assert main(["check", str(bundle), "--json"]) == 0
    assert "not compared" in json.loads(capsys.readouterr().out)["torch"]


def test_only_plain_operators_are_used(bundle: Path) -> None:
    used = set(operators(read_bundle(bundle).contents))
    assert used >= ALLOWED
    assert not used & FORBIDDEN


def test_a_flipped_byte_is_refused(bundle: Path, tmp_path: Path) -> None:
    damaged = tmp_path / "damaged"
    damaged.mkdir()
    for file in bundle.iterdir():
        data = bytearray(file.read_bytes())
        if file.name == "match.onnx":
            data[len(data) // 2] ^= 1
        (damaged / file.name).write_bytes(data)
    with pytest.raises(ModelError, match="damaged"):
        read_bundle(damaged)


def test_8_bit_bundles_run_and_find_about_the_same(
    bundle: Path, checkpoint: Path, tmp_path: Path
) -> None:
    out = tmp_path / "int8"
    common = ["flow", "--checkpoint", str(checkpoint), "--size", "96x64", "--out", str(out)]
    assert main([*common, "--precision", "int8", "--calibration-pairs", "2"]) == 0
    read = read_bundle(out)
    assert read.manifest.precision == "int8"
    graph = onnx.load_from_string(read.contents["match.onnx"]).graph
    in_8_bits = {o for n in graph.node if n.op_type == "DequantizeLinear" for o in n.output}
    layers = {n.name: n.input[1] in in_8_bits for n in graph.node if n.op_type == "Conv"}
    assert all(layers[name] for name in layers if "/update4/mix" in name)
    assert [layers[name] for name in layers if "/update4/flow" in name] == 4 * [False]
    runner = FlowRunner(read)
    first, second = drawn_pairs(SIZE, 1, 12)[0]
    field = runner.match(runner.encode(first), runner.encode(second))
    assert field.is_finite()
    exact = FlowRunner(read_bundle(bundle))
    expected = exact.match(exact.encode(first), exact.encode(second))
    # rounding moves some cells' best match, but not most
    assert np.median(np.abs(field.flow - expected.flow)) < 8.0


def test_bench_writes_one_entry_per_bundle(bundle: Path, tmp_path: Path) -> None:
    file = tmp_path / "bench.json"
    arguments = ["bench", str(bundle), str(bundle), "--size", "96x64", "--runs", "3"]
    assert main([*arguments, "--json", str(file)]) == 0
    entries = json.loads(file.read_text())
    assert len(entries) == 2
    assert set(entries[0]) == {"bundle", "precision", "median_ms", "p99_ms", "resident_mb"}
    assert all(0 < e["median_ms"] <= e["p99_ms"] for e in entries)


def test_check_reports_and_passes(bundle: Path, checkpoint: Path, capsys) -> None:
    arguments = ["check", str(bundle), "--checkpoint", str(checkpoint), "--count", "1", "--json"]
    assert main(arguments) == 0
    report = json.loads(capsys.readouterr().out)
    assert report["mean_difference_px"] < 1e-3
    assert report["operators"]["Conv"] > 20


def test_check_fails_where_the_weights_are_not_those_of_the_checkpoint(
    bundle: Path, checkpoint: Path, tmp_path: Path, capsys
) -> None:
    found = load_checkpoint(checkpoint)
    found.average["mask.bias"][0] += 0.01  # moves the flow by hundredths of a pixel
    save_checkpoint(tmp_path / "other.pt", found)
    arguments = ["check", str(bundle), "--checkpoint", str(tmp_path / "other.pt"), "--count", "1"]
    assert main([*arguments, "--json"]) == 1
    assert json.loads(capsys.readouterr().out)["greatest_difference_px"] > 1e-3


def test_half_precision_bundles_run_and_find_about_the_same(
    bundle: Path, checkpoint: Path, tmp_path: Path
) -> None:
    out = tmp_path / "half"
    common = ["flow", "--checkpoint", str(checkpoint), "--size", "96x64", "--out", str(out)]
    assert main([*common, "--precision", "fp16"]) == 0
    read = read_bundle(out)
    assert read.manifest.precision == "fp16"
    assert len(read.graph("encode")) < 0.6 * len(read_bundle(bundle).graph("encode"))
    runner, exact = FlowRunner(read), FlowRunner(read_bundle(bundle))
    first, second = drawn_pairs(SIZE, 1, 12)[0]
    field = runner.match(runner.encode(first), runner.encode(second))
    expected = exact.match(exact.encode(first), exact.encode(second))
    assert field.is_finite()
    # rounding moves some cells' best match, but not most
    assert np.median(np.abs(field.flow - expected.flow)) < 1.0


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["flow", "--model", "raft", "--out", "x"], "model 'raft'"),
        (["flow", "--checkpoint", "gone.pt", "--out", "x"], "no checkpoint at"),
        (["flow", "--size", "100x64", "--out", "x"], "multiples of 16"),
        (["flow", "--working-size", "90x64", "--out", "x"], "multiples of 16"),
        (
            ["flow", "--model", "ptlflow:x", "--working-size", "96x64", "--out", "x"],
            "dfvs-flow only",
        ),
        (["check", "nowhere"], "is not a folder"),
        (["bench", "nowhere"], "is not a folder"),
        (["bench", "nowhere", "--runs", "0"], "runs is 0"),
        (["flow", "--precision", "int8", "--out", "/dev/null"], "is no folder"),
    ],
)
def test_what_cannot_run_says_so_in_one_line(arguments, words, capsys) -> None:
    assert main(arguments) == 2
    error = capsys.readouterr().err
    assert error.startswith("error: ")
    assert words in error
    assert error.count("\n") == 1


def test_a_folder_that_is_no_bundle_is_not_overwritten(checkpoint: Path, tmp_path: Path) -> None:
    (tmp_path / "precious.txt").write_text("keep me")
    arguments = ["flow", "--checkpoint", str(checkpoint), "--size", "96x64"]
    assert main([*arguments, "--out", str(tmp_path)]) == 2
    assert (tmp_path / "precious.txt").read_text() == "keep me"


def test_a_sheet_of_pairs_is_drawn(tmp_path: Path) -> None:
    out = tmp_path / "sheet.png"
    assert main(["sheet", "--pairs", "2", "--size", "96x64", "--out", str(out)]) == 0
    assert out.stat().st_size > 10_000


def test_pictures_of_another_size_are_refused(bundle: Path) -> None:
    runner = FlowRunner(read_bundle(bundle))
    with pytest.raises(ModelError, match="shape"):
        runner.encode(np.zeros((64, 64, 3), np.uint8))


def test_the_service_runs_the_bundle_and_gives_the_same_flow(bundle: Path) -> None:
    matcher = load_matcher(f"alone:{bundle}")
    runner = FlowRunner(read_bundle(bundle))
    first, second = drawn_pairs(SIZE, 1, 13)[0]
    field = matcher.match(matcher.prepare(first), matcher.prepare(second))
    expected = runner.match(runner.encode(first), runner.encode(second))
    np.testing.assert_allclose(field.flow, expected.flow, atol=1e-4)
    np.testing.assert_allclose(field.confidence, expected.confidence, atol=1e-4)


def test_the_service_gives_flow_in_the_pixels_of_larger_pictures(bundle: Path) -> None:
    matcher = load_matcher(f"alone:{bundle}")
    first, second = drawn_pairs(SIZE, 1, 14)[0]
    small = matcher.match(matcher.prepare(first), matcher.prepare(second))
    doubled = [np.repeat(np.repeat(image, 2, axis=0), 2, axis=1) for image in (first, second)]
    large = matcher.match(*(matcher.prepare(image) for image in doubled))
    assert large.flow.shape == (2 * SIZE[1], 2 * SIZE[0], 2)
    middle = large.flow.reshape(SIZE[1], 2, SIZE[0], 2, 2).mean(axis=(1, 3))
    # random weights make flow that jumps from pixel to pixel, so compare the middle of many
    size = np.median(np.abs(middle))
    assert np.median(np.abs(middle - 2 * small.flow)) < 0.1 * size
    assert size > 1.0


def test_damaged_weights_are_refused_by_the_service(checkpoint: Path, tmp_path: Path) -> None:
    found = load_checkpoint(checkpoint)
    found.average["mask.weight"].fill_(float("nan"))
    path = tmp_path / "nan.pt"
    save_checkpoint(path, found)
    out = tmp_path / "bundle"
    arguments = ["flow", "--checkpoint", str(path), "--size", "96x64", "--out", str(out)]
    assert main(arguments) == 0
    with pytest.raises(ModelError, match="not numbers"):
        load_matcher(str(out))


def test_our_network_is_refined_unless_it_is_asked_for_alone(bundle: Path) -> None:
    matcher = load_matcher(str(bundle))
    assert not isinstance(load_matcher(f"alone:{bundle}"), HybridMatcher)
    plain = np.full((SIZE[1], SIZE[0], 3), 90, np.uint8)
    assert isinstance(matcher, HybridMatcher)
    assert matcher.match(matcher.prepare(plain), matcher.prepare(plain)).is_finite()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
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
        (["check", "dfvs-flow", "--count", "0"], "--count is 0"),
        (["sheet", "--pairs", "0", "--out", "x.png"], "0 pairs"),
        (["sheet", "--out", "x.foo"], "x.foo"),
        (["flow", "--out", "/"], "is not empty and no bundle"),
        (["train", "flow", "--steps", "0", "--out", "x"], "steps = 0"),
        (["train", "flow", "--minutes", "nan", "--out", "x"], "minutes = nan"),
        (["train", "flow", "--threads", "0", "--out", "x"], "threads = 0"),
        (["train", "flow", "--device", "nowhere", "--out", "x"], "'nowhere'"),
        (["train", "flow", "--validation", "gone.npz", "--out", "x"], "gone.npz"),
        (["train", "flow", "--out", "/dev/null/x"], "cannot be made"),
    ],
)
def test_what_is_asked_for_in_vain_is_refused_before_any_work(
    arguments, words, capsys, tmp_path, monkeypatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(arguments) == 2
    error = capsys.readouterr().err
    assert error.startswith("error: ")
    assert words in error
    assert error.count("\n") == 1


def test_a_folder_that_only_looks_like_a_bundle_is_not_overwritten(tmp_path: Path) -> None:
    (tmp_path / "manifest.json").write_text('{"name": "a web page"}')
    (tmp_path / "index.html").write_text("keep me")
    assert main(["flow", "--size", "96x64", "--out", str(tmp_path)]) == 2
    assert (tmp_path / "index.html").read_text() == "keep me"


def test_check_refuses_what_the_service_refuses(bundle: Path, tmp_path: Path, capsys) -> None:
    lying = tmp_path / "lying"
    shutil.copytree(bundle, lying)
    text = (lying / "manifest.json").read_text()
    (lying / "manifest.json").write_text(text.replace('"width": 96', '"width": 112'))
    assert main(["check", str(lying)]) == 2
    assert "graph 'encode' takes" in capsys.readouterr().err


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


@pytest.mark.parametrize("change", ["architecture", "average", "origin", "half"])
def test_checkpoints_that_no_training_wrote_are_refused(
    checkpoint: Path, tmp_path: Path, capsys, change: str
) -> None:
    fields = torch.load(checkpoint, weights_only=True)
    if change == "architecture":
        fields["architecture"]["width2"] = -4
    elif change == "average":
        fields["average"] = [1, 2]
    elif change == "origin":
        fields["origin"] = [{"settings": {}}]
    else:
        fields["average"] = {k: v.bfloat16() for k, v in fields["average"].items()}
    torch.save(fields, tmp_path / "odd.pt")
    arguments = ["flow", "--checkpoint", str(tmp_path / "odd.pt"), "--out", str(tmp_path / "x")]
    assert main(arguments) == 2
    assert "is no checkpoint" in capsys.readouterr().err


def test_bench_runs_without_torch(bundle: Path, monkeypatch, capsys) -> None:
    for name in [n for n in sys.modules if n.partition(".")[0] in ("torch", "dfvs_export")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "torch", None)
    cli = importlib.import_module("dfvs_export.cli")
    assert cli.main(["bench", "nowhere"]) == 2
    assert "nowhere" in capsys.readouterr().err
    assert cli.main(["check", str(bundle)]) == 2
    assert capsys.readouterr().err == (
        "error: torch is not installed; pip install 'dfvs[export]'\n"
    )
