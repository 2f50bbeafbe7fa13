"""Files of a recording in the order in which they were written."""

from itertools import permutations
from pathlib import Path

from dfvs_service.replay.recording import in_order

FILES = [
    Path("/media/stick/drone1-20260102T101112Z-000.mcap"),
    Path("/media/stick/drone1-20260102T101112Z-000-recovered.mcap"),
    Path("/home/me/drone1-20260102T101112Z-001.mcap"),
    Path("/home/me/drone1-20260102T112233Z-000.mcap"),
]


def test_files_are_read_in_the_order_of_their_names_whatever_folder_they_lie_in():
    assert all(in_order(order) == FILES for order in permutations(FILES))
