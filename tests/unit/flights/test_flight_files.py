"""Append-only logs, copies and bounded series: what is left of them, whatever happens."""

import pytest
from full_disk import no_file_above

from dfvs_service.flights.files import AppendFile, FileRing, LogCopy, SegmentedLog


def test_a_record_that_finds_no_room_leaves_no_part_behind(tmp_path):
    file = AppendFile(tmp_path / "log")
    file.append(b"first\n")
    with no_file_above(10), pytest.raises(OSError, match="File too large"):
        file.append(b"second\n")
    file.append(b"third\n")
    assert (tmp_path / "log").read_bytes() == b"first\nthird\n"


def test_a_copy_takes_whole_lines_alone(tmp_path):
    source, target = tmp_path / "source", tmp_path / "target"
    copy = LogCopy(source, target, 1000)
    copy.update()
    assert not target.exists()
    source.write_bytes(b"one\ntw")
    copy.update()
    assert target.read_bytes() == b"one\n"
    source.write_bytes(b"one\ntwo\n")
    copy.update()
    assert target.read_bytes() == b"one\ntwo\n"


def test_a_copy_catches_up_once_the_disk_takes_it(tmp_path):
    source, target = tmp_path / "source", tmp_path / "target"
    source.write_bytes(b"one\n")
    copy = LogCopy(source, target, 1000)
    copy.update()
    source.write_bytes(b"one\ntwo\nthree\n")
    with no_file_above(6), pytest.raises(OSError, match="File too large"):
        copy.update()
    copy.update()
    assert target.read_bytes() == source.read_bytes()


def test_a_copy_ends_with_the_last_line_that_finds_room(tmp_path):
    source, target = tmp_path / "source", tmp_path / "target"
    source.write_bytes(b"one\ntwo\nthree\n")
    copy = LogCopy(source, target, 9)
    copy.update()
    assert copy.is_full
    source.write_bytes(b"one\ntwo\nthree\n4\n")
    copy.update()
    assert target.read_bytes() == b"one\ntwo\n"


def test_a_log_keeps_its_newest_lines_and_its_size(tmp_path):
    log = SegmentedLog(tmp_path, "log", 800)
    for number in range(1000):
        log.append(b"%03d" % number)
    files = sorted(tmp_path.iterdir())
    text = b"".join(file.read_bytes() for file in files)
    assert 600 < len(text) <= 800
    lines = text.split()
    assert lines == [b"%03d" % number for number in range(1000 - len(lines), 1000)]


def test_a_ring_keeps_its_newest_files_and_its_size(tmp_path):
    ring = FileRing(tmp_path / "ring", 100)
    for number in range(10):
        ring.add(f"{number}.jpg", bytes(30))
    ring.add("huge.jpg", bytes(101))
    assert sorted(path.name for path in (tmp_path / "ring").iterdir()) == [
        "7.jpg",
        "8.jpg",
        "9.jpg",
    ]
