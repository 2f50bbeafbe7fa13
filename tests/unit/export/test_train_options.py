"""What the trainings begin with."""

import pytest

from dfvs_export.cli import main


def test_the_help_of_train_names_the_weights_that_it_begins_with(capsys):
    with pytest.raises(SystemExit):
        main(["train", "--help"])
    told = " ".join(capsys.readouterr().out.split())
    assert "(default: the shipped weights)" in told
