"""When the camera says that nobody receives, and when it ends."""

import pytest

from dfvs_service.camera.publisher import ReceptionReport
from dfvs_service.camera.sources.spec import CameraError


@pytest.fixture
def said():
    return []


def test_a_lack_of_subscribers_is_said_once_and_so_is_its_end(said):
    report = ReceptionReport(said.append, "dfvs/swift/camera", lost_s=10.0)
    report.update(11.9, is_received=False)
    assert said == []
    report.update(12.0, is_received=False)
    report.update(20.0, is_received=False)
    assert len(said) == 1
    assert said[0].startswith("nobody receives dfvs/swift/camera")
    report.update(21.0, is_received=True)
    report.update(22.0, is_received=True)
    assert said[1:] == ["dfvs/swift/camera has a subscriber"]


def test_the_time_without_a_subscriber_counts_from_its_loss(said):
    report = ReceptionReport(said.append, "key", lost_s=0.0, required_s=5.0)
    report.update(4.9, is_received=True)
    report.update(6.0, is_received=False)
    report.update(10.9, is_received=False)
    with pytest.raises(CameraError, match="nobody receives key for 5 s"):
        report.update(11.0, is_received=False)
