"""Commands of ``dfvs-robustness`` that cannot run: one line says why."""

import pytest

from dfvs_robustness.cli import main

FOLDER_FOR_FILE = ("answers", "faults", "fuzz commands", "fuzz frames", "fuzz gate", "soak")


@pytest.mark.parametrize(
    ("command", "option", "value"),
    [
        ("fuzz gate", "--events", 0),
        ("fuzz gate", "--workers", 0),
        ("fuzz gate", "--seed", -1),
        ("fuzz gate", "--out", "/nowhere"),
        ("fuzz frames", "--count", 0),
        ("fuzz frames", "--workers", 0),
        ("fuzz frames", "--seed", -1),
        ("fuzz frames", "--show", -1),
        ("soak", "--rate", 0.5),
        ("soak", "--seed", -1),
        ("soak", "--minutes", 0),
        ("soak", "--minutes", "nan"),
        ("soak", "--minutes", "1e9"),
        ("answers", "--tries", 0),
        ("answers", "--seconds", 0.5),
        ("answers", "--json", "no/such/folder/a.json"),
        *((command, "--json", ".") for command in FOLDER_FOR_FILE),
        ("faults", "--html", "."),
        ("faults", "--minutes", "nan"),
    ],
)
def test_an_impossible_option_is_named(command, option, value, refused, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert f"{option} " in refused(main, *command.split(), option, value)


def test_words_that_the_service_refuses_start_no_soak(refused, tmp_path):
    words = ("--out", tmp_path / "out", "--service", "--enagge auto")
    assert "unrecognized arguments: --enagge" in refused(main, "soak", *words)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("target", ["gate", "commands"])
@pytest.mark.parametrize("text", ["", "[]", "{}", '{"format": "x"}', "\xff", None])
def test_a_file_that_is_no_replay_is_named(target, text, refused, tmp_path):
    path = tmp_path / "bad.json"
    if text is not None:
        path.write_text(text, encoding="latin-1")
    assert str(path) in refused(main, "fuzz", target, "--replay", path)


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"tries": [{}]}'])
def test_a_file_that_holds_no_answer_times_is_named(text, refused, tmp_path):
    path = tmp_path / "answers.json"
    path.write_text(text)
    words = ("faults", "--minutes", 0, "--answers", path)
    assert f"{path} holds no answer times" in refused(main, *words)


@pytest.mark.parametrize("text", ["I1: x", "1", "[1]", '{"fault": "black"}', '{"f', "\xff"])
def test_a_file_that_holds_no_results_of_the_matrix_is_named(text, refused, tmp_path):
    path = tmp_path / "runs.jsonl"
    path.write_text(f'{{"violation": "I1: x"}}\n{text}', encoding="latin-1")
    words = ("faults", "--minutes", 0, "--keep", path)
    assert f"{path} holds no results" in refused(main, *words)
