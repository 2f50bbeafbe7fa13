"""Where TensorRT keeps its engines; no machine of the tests has TensorRT."""

import os
from pathlib import Path

import onnxruntime
import pytest

from dfvs_models.onnx_session import Execution, provider_options

TENSORRT = "TensorrtExecutionProvider"


@pytest.fixture
def tensorrt(monkeypatch):
    names = [TENSORRT, "CPUExecutionProvider"]
    monkeypatch.setattr(onnxruntime, "get_available_providers", lambda: names)

    def execution(folder):
        return Execution(provider=TENSORRT, engine_cache=str(folder))

    return execution


def test_engines_are_kept_apart_by_the_bytes_of_their_graphs(tensorrt, tmp_path):
    """Its own names of engines are the same for other weights."""
    one, other, again = (
        provider_options(data, tensorrt(tmp_path / "engines")) for data in (b"1", b"2", b"1")
    )
    assert one["trt_engine_cache_enable"] == "True"
    assert one["trt_engine_cache_path"].startswith(f"{tmp_path}/engines/")
    assert one == again
    assert one["trt_engine_cache_path"] != other["trt_engine_cache_path"]


def test_engines_of_another_onnx_runtime_are_not_mixed(tensorrt, tmp_path, monkeypatch):
    one = provider_options(b"1", tensorrt(tmp_path))
    monkeypatch.setattr(onnxruntime, "__version__", "0.0.1")
    assert provider_options(b"1", tensorrt(tmp_path)) != one


def test_engines_of_the_graphs_used_last_are_kept_whatever_the_clock_says(
    tensorrt, tmp_path, monkeypatch
):
    (tmp_path / "mine").mkdir()
    for second in range(20):
        monkeypatch.setattr("time.time_ns", lambda second=second: (100 + second) * 10**9)
        path = Path(provider_options(b"%d" % second, tensorrt(tmp_path))["trt_engine_cache_path"])
        (path / "engine").touch()
        os.utime(path, ns=((100 + second) * 10**9,) * 2)
    monkeypatch.setattr("time.time_ns", lambda: 0)
    kept = {folder.name for folder in tmp_path.iterdir()} - {"mine"}
    assert len(kept) == 16
    assert path.name in kept
    for data in (b"19", b"new", b"newer"):
        assert Path(provider_options(data, tensorrt(tmp_path))["trt_engine_cache_path"]).is_dir()
    left = {folder.name for folder in tmp_path.iterdir()}
    assert len(left) == 17
    assert path.name in left
    assert (tmp_path / "mine").is_dir()


def test_the_folders_are_private_where_groups_may_write_to_new_ones(tensorrt, tmp_path):
    before = os.umask(0o002)
    try:
        assert provider_options(b"1", tensorrt(tmp_path / "engines"))
    finally:
        os.umask(before)
    (folder,) = (tmp_path / "engines").iterdir()
    assert [path.stat().st_mode & 0o777 for path in (folder, folder.parent)] == [0o700, 0o700]


def test_other_providers_and_no_folder_keep_nothing(tensorrt, tmp_path):
    assert provider_options(b"1", tensorrt("")) == {}
    assert provider_options(b"1", Execution(engine_cache=str(tmp_path))) == {}
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("mode", [0o770, 0o707])
def test_engines_that_another_user_could_replace_are_not_used(tensorrt, tmp_path, mode, capsys):
    tmp_path.chmod(mode)
    assert provider_options(b"1", tensorrt(tmp_path)) == {}
    assert f"engines cannot be kept in {tmp_path}" in capsys.readouterr().err


def test_a_folder_that_cannot_be_made_keeps_nothing_and_is_told_once(tensorrt, tmp_path, capsys):
    (tmp_path / "file").touch()
    for data in (b"1", b"2"):
        assert provider_options(data, tensorrt(tmp_path / "file" / "engines")) == {}
    assert capsys.readouterr().err.count("engines cannot be kept") == 1
