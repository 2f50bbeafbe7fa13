"""The page of the fault matrix, as its readers see it."""

import re

from dfvs_core.gate.states import GateState
from dfvs_robustness.faults.fault import Outcome
from dfvs_robustness.faults.matrix import all_faults
from dfvs_robustness.faults.report import Report, make_rows


def test_the_page_has_a_key_to_its_marks_and_units_to_its_times():
    name = "saturated"
    outcome = Outcome(name, GateState.SERVO, 0, True, 90.0, "the image is white")
    page = Report(make_rows([outcome], all_faults()), [], 0).html()
    assert "time of one case between 0 and the row's limit" in page
    heads = re.findall("<th>(.*?)</th>", page)
    assert [h for h in heads if re.match("p50|p99|max|limit", h) and not h.endswith(" ms")] == []
    assert "<td>white image</td>" in page


def test_faults_name_an_image_as_one():
    assert [f.what for f in all_faults().values() if "picture" in f.what] == []
