"""The Region-based Deformable Net: regions of an image, followed from frame to frame."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from host.rbdn.config import NetConfig

if TYPE_CHECKING:
    from host.rbdn.net import Net
    from host.rbdn.snapshot import Contour, Event, Region, Snapshot, Vertices

__all__ = ["Contour", "Event", "Net", "NetConfig", "Region", "Snapshot", "Vertices"]


def __getattr__(name: str) -> Any:
    # Arrays, engine and OpenCV load on first use, so that settings and --help need not wait for them.
    if name not in __all__:
        raise AttributeError(name)
    return getattr(import_module("host.rbdn.net" if name == "Net" else "host.rbdn.snapshot"), name)
