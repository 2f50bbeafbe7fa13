"""Options of ``dfvs-bench lockstep`` that cannot be used."""

import pytest

from dfvs_bench.cli import main


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (["--seeds", "a-3"], "--seeds is 'a-3'"),
        (["--hold", "0"], "--hold is 0"),
        (["--timeout", "4000"], "--timeout is 4000"),
        (["--speed", "-1"], "--speed is -1"),
        (["--slew", "6"], "--slew is 6"),
    ],
)
def test_an_option_that_cannot_be_used_is_named_with_its_value(words, named, capsys):
    assert main(["lockstep", *words]) == 2
    assert named in capsys.readouterr().err
