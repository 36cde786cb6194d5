"""What the link's tests share."""

from __future__ import annotations

import pytest
from link_in_c import LinkInC


@pytest.fixture(scope="session")
def c_link(tmp_path_factory: pytest.TempPathFactory) -> LinkInC:
    """The firmware's link, compiled once; call `fresh()` before use."""
    return LinkInC(tmp_path_factory.mktemp("link"))
