"""What a board's EEPROM holds, byte for byte: parameters as firmware/src/params.h lays them out."""

from __future__ import annotations

import struct
from collections.abc import Mapping

from host.link.parameters import PARAMETERS, Param
from host.link.protocol import PARAMS_VERSION, crc32c

SIZE = 1024
FIRST_SLOT = 16
MARK = b"\xa5"


def slot(values: Mapping[Param, int], generation: int = 1) -> bytes:
    """One slot with these values, and the defaults of the other parameters."""
    for param, value in values.items():
        lowest, highest = PARAMETERS[param].lowest, PARAMETERS[param].highest
        if not lowest <= value <= highest:
            raise ValueError(f"{param.name} must be {lowest} to {highest}, not {value}")
    every = (values.get(param, PARAMETERS[param].default) for param in PARAMETERS)
    checked = struct.pack(f"<II{len(PARAMETERS)}i", PARAMS_VERSION, generation, *every)
    return checked + struct.pack("<I", crc32c(checked)) + MARK


def image(values: Mapping[Param, int]) -> bytes:
    """A whole EEPROM as it is after these values were saved to an erased one.

    Raises
    ------
    ValueError
        A value is out of its parameter's range.
    """
    return (b"\xff" * FIRST_SLOT + slot(values)).ljust(SIZE, b"\xff")
