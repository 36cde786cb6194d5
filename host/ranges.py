"""Settings that are numbers, each held to the range in which it makes sense."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any


def check_ranges(settings: Any, ranges: Mapping[str, tuple[float, float]]) -> None:
    """See that every number among the settings is of its kind and within its range, both ends included.

    Parameters
    ----------
    settings
        Of a dataclass; a field whose default is a whole number takes whole numbers alone.
    ranges
        Lowest and highest by the field's name, for every field that is a number.

    Raises
    ------
    ValueError
        naming key, value and range.
    """
    for field in dataclasses.fields(settings):
        if isinstance(field.default, bool) or not isinstance(field.default, int | float):
            continue
        value, whole = getattr(settings, field.name), isinstance(field.default, int)
        if not isinstance(value, int if whole else int | float) or isinstance(value, bool):
            raise ValueError(f"{field.name} = {value!r} is not a {'whole ' if whole else ''}number")
        low, high = ranges[field.name]
        if not low <= value <= high:
            raise ValueError(f"{field.name} = {value} is outside {low:.10g} to {high:.10g}")
