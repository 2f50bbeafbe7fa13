"""Which calibration boards can be drawn at which resolution."""

import pytest

from dfvs_service.camera import cli


@pytest.mark.parametrize(
    ("board", "dpi", "message"),
    [
        ("charuco:7x5:0.001:0.0007", 50, "squares of 2 px are too small for the markers"),
        ("chessboard:9x6:0.0001", 50, "squares of 0.0001 m"),
        ("chessboard:9x6:0.5", 600, "a sheet of 118109 x 82676 px"),
        ("charuco:7x5:0.4:0.3", 1200, "a sheet of 151184 x 113388 px"),
    ],
)
def test_a_board_too_small_or_too_large_to_draw_is_refused(board, dpi, message, tmp_path, refused):
    path = tmp_path / "board.png"
    assert message in refused(cli.main, "board", "--board", board, "--dpi", dpi, "--out", path)
    assert not path.exists()
