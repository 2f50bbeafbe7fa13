import pytest

from dfvs_service import cli as service
from dfvs_service.camera import cli as camera
from dfvs_service.ros2 import cli as ros2


@pytest.mark.parametrize(
    ("main", "words"),
    [
        (camera.main, []),
        (camera.main, ["board"]),
        (camera.main, ["calibrate"]),
        (camera.main, ["goal"]),
        (ros2.main, []),
        (service.main, []),
        (service.main, ["config"]),
        (service.main, ["command"]),
        (service.main, ["teach"]),
    ],
)
def test_every_command_helps_with_an_example(main, words, capsys):
    with pytest.raises(SystemExit) as end:
        main([*words, "--help"])
    assert end.value.code == 0
    assert "example" in capsys.readouterr().out


@pytest.mark.parametrize(("main", "word"), [(camera.main, "calib"), (service.main, "check")])
def test_a_word_that_is_no_command_is_named(main, word, refused):
    assert f"there is no command '{word}'" in refused(main, word)
