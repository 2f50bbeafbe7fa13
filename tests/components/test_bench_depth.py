"""``dfvs-bench depth`` on a pairs file made here."""

import json
import shutil

import depth_bundle
import numpy as np
import onnx_network
import pytest

from dfvs_bench.cli import main

SIZE = (24, 32)


@pytest.fixture
def pairs(tmp_path):
    depth = np.full((2, *SIZE), 2.0, np.float16)
    depth[:, :, :16] = 4.0
    np.savez(tmp_path / "room.npz", IA=np.full((2, *SIZE, 3), 90, np.uint8), depth=depth)
    return tmp_path / "room.npz"


def bundle_folder(path, values, unit="1/m"):
    made = depth_bundle.bundle(np.asarray(values, np.float32), unit=unit)
    return onnx_network.write_bundle(path, made)


def test_the_table_and_the_json_tell_metric_and_aligned_errors(pairs, tmp_path, capsys):
    rho = np.full((12, 16), 0.25)
    rho[:, 8:] = 0.5
    folder = bundle_folder(tmp_path / "twice", 2.0 * rho)
    out = tmp_path / "depth.json"
    assert main(["depth", str(pairs), "--depth-bundle", str(folder), "--json", str(out)]) == 0
    (report,) = json.loads(out.read_text())
    measured = report["files"]["room.npz"]
    score = measured["score"]
    assert measured["images"] == 2
    assert score["metric"]["abs_rel"] == pytest.approx(0.5, abs=0.02)
    assert score["aligned"]["abs_rel"] < 0.02
    assert measured["median_ms"] > 0.0
    assert score["scale_log"] == pytest.approx(np.log(2.0), abs=0.02)
    printed = capsys.readouterr().out
    assert "aligned" in printed
    assert "ln scale off by 0.69" in printed


def test_the_scale_of_an_affine_network_is_no_error(pairs, tmp_path, capsys):
    folder = bundle_folder(tmp_path / "affine", np.full((12, 16), 0.5), "affine")
    assert main(["depth", str(pairs), "--depth-bundle", str(folder)]) == 0
    assert "ln scale" not in capsys.readouterr().out


def test_files_of_one_name_are_each_measured(pairs, tmp_path):
    (tmp_path / "other").mkdir()
    other = shutil.copy(pairs, tmp_path / "other" / "room.npz")
    folder = bundle_folder(tmp_path / "b", np.full((12, 16), 0.5))
    words = ["depth", str(pairs), str(other), "--depth-bundle", str(folder)]
    assert main([*words, "--json", str(tmp_path / "out.json")]) == 0
    (report,) = json.loads((tmp_path / "out.json").read_text())
    assert sorted(report["files"]) == sorted([str(pairs), str(other)])


def test_a_file_without_depth_is_refused_and_nothing_is_written(pairs, tmp_path, refused):
    folder = bundle_folder(tmp_path / "b", np.full((12, 16), 0.5))
    np.savez(tmp_path / "flow.npz", IA=np.zeros((2, *SIZE, 3), np.uint8))
    words = ["depth", tmp_path / "flow.npz", "--depth-bundle", folder]
    assert "depth" in refused(main, *words, "--json", tmp_path / "out.json")
    assert not (tmp_path / "out.json").exists()
