"""What the firmware's tests share."""

from __future__ import annotations

import pytest
from firmware_in_c import FirmwareInC


@pytest.fixture(scope="session")
def firmware(tmp_path_factory: pytest.TempPathFactory) -> FirmwareInC:
    """The firmware's parts, compiled once."""
    return FirmwareInC(tmp_path_factory.mktemp("firmware_in_c"))
