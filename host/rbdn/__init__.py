"""The Region-based Deformable Net: regions of an image, followed from frame to frame."""

from host.rbdn.config import NetConfig
from host.rbdn.net import Net
from host.rbdn.snapshot import Contour, Event, Region, Snapshot, Vertices

__all__ = ["Contour", "Event", "Net", "NetConfig", "Region", "Snapshot", "Vertices"]
