"""What the benchmark's report says of its tasks."""

import pytest

from dfvs_bench.report.report import Contents, report_page
from dfvs_bench.trials.scenes import default_tasks
from dfvs_bench.trials.settings import setting_tasks

KEPT, OTHER = "its initial distances and angles are kept", "and so are the tasks"


@pytest.mark.parametrize(
    ("setting", "said"),
    [("default", [KEPT]), ("near", [OTHER]), ("none", [])],
)
def test_only_the_paper_s_initial_errors_are_said_to_be_kept(tmp_path, setting, said):
    if setting == "default":
        tasks = default_tasks()
    else:
        tasks = [] if setting == "none" else setting_tasks(setting, 0.25, tmp_path)
    page = report_page(Contents(tasks), lambda _: None)
    assert [text for text in (KEPT, OTHER) if text in page] == said
