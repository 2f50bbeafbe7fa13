"""A gate process without a vehicle."""

import os

import pytest

from dfvs_service.gate.process import GateProcess
from dfvs_service.settings.config import load_config
from dfvs_service.settings.runtime import RuntimeFolder


@pytest.fixture
def gate(tmp_path):
    read, write = os.pipe()
    gate = GateProcess(load_config(None, {}), RuntimeFolder(tmp_path), None, read)
    yield gate
    gate.close()
    os.close(read)
    os.close(write)
