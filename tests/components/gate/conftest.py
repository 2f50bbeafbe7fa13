"""A vehicle in the air, and a key to command its service."""

import pytest
from gate_flight import hovering_vehicle

from dfvs_service.settings.key_file import create_key


@pytest.fixture(scope="module")
def vehicle(tmp_path_factory):
    """One for all tests of a module; it holds between them."""
    with hovering_vehicle(tmp_path_factory.mktemp("vehicle")) as hovering:
        yield hovering


@pytest.fixture
def key_file(tmp_path):
    create_key(tmp_path / "key")
    return tmp_path / "key"
