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
        ("--set flow.threads=1 --on-done hold", Engagement.PILOT),
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


def test_what_the_service_itself_will_refuse_is_left_to_it(tmp_path):
    assert engagement_of(["--config", str(tmp_path / "nowhere.toml")]) is Engagement.PILOT
    assert engagement_of(["--engage", "somehow"]) is Engagement.PILOT
    assert engagement_of(["--engage"]) is Engagement.PILOT


def test_a_service_that_never_engages_is_refused():
    with pytest.raises(ConfigError, match="never"):
        engagement_of(["--engage", "never"])
