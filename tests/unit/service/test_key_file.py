import pytest
from full_disk import no_file_above

from dfvs_core.errors import ConfigError
from dfvs_service.settings.key_file import create_key, load_key


def test_a_new_key_is_random_private_and_usable(tmp_path):
    first, second = tmp_path / "a", tmp_path / "b"
    create_key(first)
    create_key(second)
    assert first.stat().st_mode & 0o777 == 0o600
    assert len(load_key(first)) == 64
    assert load_key(first) != load_key(second)


def test_a_key_is_never_overwritten(tmp_path):
    path = tmp_path / "a"
    create_key(path)
    before = path.read_bytes()
    with pytest.raises(ConfigError, match="cannot create"):
        create_key(path)
    assert path.read_bytes() == before


def test_a_key_that_the_disk_has_no_room_for_is_not_there_at_all(tmp_path):
    with no_file_above(0), pytest.raises(ConfigError, match="cannot create"):
        create_key(tmp_path / "a")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("mode", [0o640, 0o604, 0o660, 0o644])
def test_a_key_that_others_can_read_is_refused(tmp_path, mode):
    path = tmp_path / "a"
    create_key(path)
    path.chmod(mode)
    with pytest.raises(ConfigError, match="chmod 600"):
        load_key(path)


@pytest.mark.parametrize("content", [b"", b"   \n", b"short", b"fifteen letters"])
def test_a_short_key_is_refused(tmp_path, content):
    path = tmp_path / "a"
    path.write_bytes(content)
    path.chmod(0o600)
    with pytest.raises(ConfigError, match="at least 16 bytes"):
        load_key(path)


def test_a_missing_key_says_how_to_make_one(tmp_path):
    with pytest.raises(ConfigError, match="new-key"):
        load_key(tmp_path / "none")
