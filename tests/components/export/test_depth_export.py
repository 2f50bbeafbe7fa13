"""Depth bundles by ``dfvs-export depth``. No published weights can be had here: the weights are
seeded random ones, and what is tested is the path, the parity with torch and the contract."""

import importlib.util
import shlex
import sys
from pathlib import Path

import numpy as np
import pytest
import torch

from dfvs_core.geometry.camera import CameraModel
from dfvs_export.bundles.bundle import CARD_NAME
from dfvs_export.bundles.depth import DepthModel
from dfvs_export.checks.parity import PARITY_LIMIT, drawn_pairs
from dfvs_export.cli import main
from dfvs_export.commands.comparison import agrees_with_torch
from dfvs_export.networks.densedepth import DenseDepth
from dfvs_export.networks.depth import DepthNet
from dfvs_export.weights.depth import TrainedDepth, load_depth_weights
from dfvs_export.weights.published_depth import ANYTHING, DENSE, MIDAS, DepthWeights
from dfvs_models.bundle import read_bundle
from dfvs_models.catalog import load_depth
from dfvs_models.depth import DepthNetwork
from dfvs_models.onnx_session import Execution

SMALL = (64, 64)


def checkpoint(path, bias=0.0):
    """Weights of dfvs-depth as they are drawn, with something added to its output."""
    torch.manual_seed(3)
    network = DepthNet()
    with torch.no_grad():
        network.head.bias += bias
    TrainedDepth(network.state_dict(), "drawn", "None.").save(path)
    return ["--model", "dfvs-depth", "--checkpoint", str(path)]


@pytest.fixture(scope="module")
def own(tmp_path_factory):
    """Arguments that convert dfvs-depth, its checkpoint last."""
    return checkpoint(tmp_path_factory.mktemp("weights") / "depth.pt")


@pytest.fixture(scope="module")
def converted(own, tmp_path_factory):
    """Folder of dfvs-depth as a bundle."""
    out = tmp_path_factory.mktemp("converted") / "depth"
    assert main(["depth", *own, "--out", str(out)]) == 0
    return out


def needs(package):
    found = importlib.util.find_spec(package) is not None
    return pytest.mark.skipif(not found, reason=f"{package} comes with dfvs-lab[published-depth]")


def test_files_of_one_name_are_each_measured_for_the_card(own, tmp_path, capsys):
    files = [tmp_path / name / "room.npz" for name in "ab"]
    for file in files:
        file.parent.mkdir()
        np.savez(file, IA=np.full((1, 24, 32, 3), 90, np.uint8), depth=np.full((1, 24, 32), 2.0))
    words = [*own, "--out", str(tmp_path / "bundle")]
    assert main(["depth", *words, "--pairs", *map(str, files)]) == 0
    card = (tmp_path / "bundle" / CARD_NAME).read_text(encoding="utf-8")
    assert [str(file) in card for file in files] == [True, True]
    assert "random" not in capsys.readouterr().out


def test_our_network_becomes_a_bundle_that_the_service_loads(converted, own):
    manifest = read_bundle(converted).manifest
    assert manifest.graphs["mono"].inputs == ("image", "focal")
    assert manifest.depth is not None
    assert (manifest.depth.unit, manifest.depth.stride) == ("1/m", 2)
    network = load_depth("fused", str(converted))
    camera = CameraModel.from_horizontal_fov(320, 240, 1.2)
    image = drawn_pairs((320, 240), 1, 5)[0][0]
    found = network.estimate(image, camera)
    wanted, _ = load_depth_weights(Path(own[-1])).network()(
        torch.from_numpy(image.transpose(2, 0, 1)[None].astype(np.float32) / 255.0),
        torch.tensor([[camera.fx / 320]], dtype=torch.float32),
    )
    at = np.s_[1:-1:2, 1:-1:2]
    corners = wanted[0].detach().numpy()
    middle = 9 * corners[:-1, :-1] + 3 * corners[1:, :-1] + 3 * corners[:-1, 1:] + corners[1:, 1:]
    np.testing.assert_allclose(found.rho[at], middle / 16, rtol=2e-3)
    assert 0.0 < found.spread.min() < found.spread.max() < 1.0


def test_the_bundle_in_eight_bits_gives_nearly_the_same(own, converted, tmp_path):
    folders = [converted, tmp_path / "int8"]
    words = ["--precision", "int8", "--calibration-pairs", "2", "--out", str(folders[1])]
    assert main(["depth", *own, *words]) == 0
    assert read_bundle(folders[1]).manifest.precision == "int8"
    camera, image = CameraModel.from_horizontal_fov(320, 240, 1.2), drawn_pairs((320, 240), 1, 5)[0]
    full, few = (load_depth("fused", str(f)).estimate(image[0], camera).rho for f in folders)
    assert not np.array_equal(full, few)
    np.testing.assert_allclose(few, full, rtol=0.1)


def test_check_compares_with_torch(own, converted, told):
    assert 0.0 < told("check", converted, *own, "--count", 1)["greatest_difference"] <= PARITY_LIMIT
    assert "not compared" in told("check", converted)["torch"]


def test_check_tells_a_bundle_of_other_weights(converted, tmp_path, told):
    other = checkpoint(tmp_path / "other.pt", bias=0.01)
    report = told("check", converted, *other, "--count", 1, code=1)
    assert report["greatest_difference"] > PARITY_LIMIT


def test_bench_times_a_depth_bundle(converted, capsys):
    assert main(["bench", str(converted), "--runs", "2", "--threads", "1"]) == 0
    assert "depth " in capsys.readouterr().out


def test_densedepth_has_the_size_of_the_published_one():
    """42.6 million parameters, by the authors' own count."""
    count = sum(parameter.numel() for parameter in DenseDepth().parameters())
    assert round(count / 1e5) in (426, 427)


def test_densedepth_with_random_weights_is_as_in_torch():
    model = DepthModel.load(DENSE, DepthWeights())
    bundle = model.bundle(SMALL)
    assert agrees_with_torch(model, bundle)
    image = drawn_pairs(SMALL, 1, 5)[0][0]
    camera = CameraModel.from_horizontal_fov(*SMALL, 1.2)
    found = DepthNetwork(bundle, Execution(1)).estimate(image, camera)
    assert found.unit == "1/m"
    assert float(np.ptp(found.rho)) > 1e-4  # no constant, whose parity would say nothing
    assert "RANDOM" in bundle.manifest.origin


@pytest.mark.parametrize(
    ("name", "size"),
    [
        pytest.param(MIDAS, SMALL, marks=needs("geffnet")),
        pytest.param(ANYTHING, (70, 70), marks=needs("transformers")),
    ],
)
def test_published_networks_with_random_weights_are_as_in_torch(name, size):
    model = DepthModel.load(name, DepthWeights())
    bundle = model.bundle(size)
    assert agrees_with_torch(model, bundle)
    assert bundle.manifest.depth is not None
    assert bundle.manifest.depth.unit == "affine"
    camera = CameraModel.from_horizontal_fov(100, 60, 1.2)
    image = drawn_pairs((100, 60), 1, 5)[0][0]
    assert DepthNetwork(bundle, Execution(1)).estimate(image, camera).rho.shape == (60, 100)


@needs("transformers")
@pytest.mark.parametrize(("kind", "unit"), [("relative", "affine"), ("metric", "m")])
def test_a_folder_of_transformers_is_read(tmp_path, kind, unit):
    import transformers

    from dfvs_core.messages.manifest import sha256
    from dfvs_export.networks.depth_anything import _SMALL

    torch.manual_seed(1)
    config = transformers.DepthAnythingConfig(**_SMALL, depth_estimation_type=kind, max_depth=20)
    transformers.DepthAnythingForDepthEstimation(config).save_pretrained(tmp_path / "folder")
    digest = sha256((tmp_path / "folder" / "model.safetensors").read_bytes())
    model = DepthModel.load(ANYTHING, DepthWeights(folder=tmp_path / "folder", sha256=digest))
    bundle = model.bundle((70, 70))
    assert bundle.manifest.depth is not None
    assert bundle.manifest.depth.unit == unit
    assert "RANDOM" not in bundle.manifest.origin
    assert agrees_with_torch(model, bundle)


@pytest.mark.parametrize(("name", "package"), [(MIDAS, "geffnet"), (ANYTHING, "transformers")])
def test_a_package_that_is_missing_is_named_in_one_line(
    name, package, tmp_path, monkeypatch, refused
):
    monkeypatch.setitem(sys.modules, package, None)
    error = refused(main, "depth", "--model", name, "--out", tmp_path / "b")
    assert package in error
    assert "dfvs-lab[published-depth]" in error
    assert not (tmp_path / "b").exists()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("--model dfvs-depth --checkpoint no.pt", "no weights at no.pt"),
        ("--model dfvs-depth --sha256 abc", "--sha256 for dfvs-depth; expected it beside"),
        ("--model densedepth --sha256 abc", "--sha256 for densedepth; expected it beside"),
        ("--model densedepth --size 100x100", "multiples of 32"),
        ("--model densedepth --from .", "--from for densedepth"),
        ("--model densedepth --checkpoint nowhere.pt", "cannot be read"),
        ("--model densedepth --size 64x64 --spread 0", "spread"),
        ("--model depth-anything-v2-small --checkpoint x.pt", "--from FOLDER"),
        ("--model depth-anything-v2-small --from nowhere", "cannot be read"),
        ("--calibration x.npz", "--precision int8"),
    ],
)
def test_what_cannot_be_converted_is_refused_in_one_line(words, said, tmp_path, refused_at_last):
    assert said in refused_at_last("depth", *shlex.split(words), "--out", tmp_path / "b")
    assert not (tmp_path / "b").exists()


def test_weights_without_a_hash_are_not_loaded(tmp_path, refused):
    path = tmp_path / "weights.pt"
    torch.save({"encoder.stem.0.weight": torch.zeros(1)}, path)
    words = ["depth", "--model", "densedepth", "--checkpoint", path, "--out", tmp_path / "b"]
    assert "add --sha256" in refused(main, *words)
    assert "has SHA-256" in refused(main, *words, "--sha256", "0" * 64)


def test_the_size_of_our_network_is_fixed(own, tmp_path, refused_at_last):
    error = refused_at_last("depth", *own, "--size", "640x480", "--out", tmp_path / "b")
    assert "320x240 for dfvs-depth" in error
