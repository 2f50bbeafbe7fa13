"""Who engages, by the words that the demo hands to the service."""

import pytest

from dfvs_core.errors import ConfigError
from dfvs_sim.demo.flight.engagement import Engagement, engagement_of


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ("", Engagement.PILOT),
        ("--engage auto", Engagement.AUTO),
        ("--engage=command", Engagement.COMMAND),
        ("--set gate.engage=auto", Engagement.AUTO),
        ("--set gate.engage='command'", Engagement.COMMAND),
        ("--set=gate.engage=auto --engage pilot", Engagement.PILOT),
        ("--engage pilot --set gate.engage=auto", Engagement.PILOT),
        ("--set flow.threads=1 --on-done hold --runtime-dir run --json-log", Engagement.PILOT),
    ],
)
def test_the_option_counts_before_the_setting(words, expected):
    assert engagement_of(words.split()) is expected


def test_a_settings_file_counts_where_nothing_else_is_said(tmp_path):
    file = tmp_path / "service.toml"
    file.write_text("[gate]\nengage = 'auto'\n")
    assert engagement_of(["--config", str(file)]) is Engagement.AUTO
    assert engagement_of(["--config", str(file), "--engage", "pilot"]) is Engagement.PILOT
    file.write_text("[servo]\n")
    assert engagement_of([f"--config={file}"]) is Engagement.PILOT


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("--engage never", "engage never"),
        ("--engage somehow", "invalid choice: 'somehow'"),
        ("--config nowhere.toml", "nowhere.toml"),
        ("--help", "'--help' are no words of a flight"),
    ],
)
def test_a_service_that_would_not_fly_with_its_words_is_refused(words, message):
    with pytest.raises(ConfigError, match=message):
        engagement_of(words.split())
