"""The folder in which recordings are made."""

from pathlib import Path

import pytest

from dfvs_core.errors import ConfigError
from dfvs_service.record.preparation import prepare_folder


def test_a_folder_below_the_home_folder_may_be_named_in_the_settings(tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    monkeypatch.chdir(tmp_path)
    assert prepare_folder(Path("~/flights")) == tmp_path / "home" / "flights"
    assert [path.name for path in tmp_path.iterdir()] == ["home"]


@pytest.mark.parametrize("name", ["~nobody-of-this-name/flights", "/proc/self/flights"])
def test_a_folder_that_cannot_be_made_is_one_error(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ConfigError, match="cannot be made"):
        prepare_folder(Path(name))
