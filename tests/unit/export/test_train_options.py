"""What the trainings begin with: their help, and the commands of the page on networks."""

import shlex
from pathlib import Path

import pytest

from dfvs_export.cli import main

PAGE = Path(__file__).parents[3] / "docs" / "how-to" / "networks.md"


def test_the_help_of_train_names_the_weights_that_it_begins_with(capsys):
    with pytest.raises(SystemExit):
        main(["train", "--help"])
    told = " ".join(capsys.readouterr().out.split())
    assert "(default: the shipped weights)" in told


def test_what_the_page_goes_on_from_is_learnt_from_pairs_of_another_seed():
    lines = PAGE.read_text(encoding="utf-8").splitlines()
    commands = [shlex.split(line)[1:] for line in lines if line.startswith("dfvs-export train")]
    options = [dict(zip(words[1::2], words[2::2], strict=True)) for words in commands]
    made = {o["--out"] for o in options}
    further = [o for o in options if o.get("--from") in made]
    assert further
    assert all(int(o.get("--seed", 0)) > 0 for o in further)
