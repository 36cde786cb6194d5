"""The Region-based Deformable Net: regions of an image, followed from frame to frame."""

from typing import TYPE_CHECKING, Any

from host.rbdn.config import NetConfig
from host.rbdn.snapshot import Contour, Event, Region, Snapshot, Vertices

if TYPE_CHECKING:
    from host.rbdn.net import Net

__all__ = ["Contour", "Event", "Net", "NetConfig", "Region", "Snapshot", "Vertices"]


def __getattr__(name: str) -> Any:
    # The engine and OpenCV load on first use, so that settings and --help need not wait for them.
    if name == "Net":
        from host.rbdn.net import Net

        return Net
    raise AttributeError(name)
