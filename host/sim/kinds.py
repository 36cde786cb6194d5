"""Which robots are simulated ones, by their URI; knows nothing of how, and so takes no time to load."""

from __future__ import annotations

KINDS = ("sim", "avr")


def is_simulated(uri: str) -> bool:
    """Does a robot's URI name a simulated one?"""
    return uri.partition(":")[0] in KINDS and ":" in uri
