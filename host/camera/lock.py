"""What a camera does by itself is held still, and seen to be: exposure, white balance, gain and focus.

Measuring by size and colour needs pictures that differ by the robot's motion alone. Each control is read back
after it was set, and at the end pictures must be as bright as automatic exposure had them, and stay so.
"""

from __future__ import annotations

import statistics
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from host.camera.config import WebcamConfig
from host.camera.v4l2 import Control, Driver

SETTLE_PICTURES = 20  # for what is automatic to find its values
TAKES_EFFECT_PICTURES = 3
STEADY_PICTURES = 8
MATCH_STEPS = 6
ALIKE = 1.2  # as bright as before: at most by this factor off
STEADY = 0.04  # brightness may vary by so much: noise, lamps on mains
STEADY_COLOUR = 0.03  # and the ratio of two colours
EVERY_PX = 8
DARK_LEVELS = 4.0  # a picture this dark tells nothing of how bright it should be


@dataclass(frozen=True)
class Knob:
    """Something automatic: the control that turns it off, and that of the value it then has."""

    what: str
    automatic_id: int
    manual: int  # the value of the former that leaves it to us
    automatic: int
    value_id: int


EXPOSURE = Knob("exposure", 0x009A0901, 1, 3, 0x009A0902)
FOCUS = Knob("focus", 0x009A090C, 0, 1, 0x009A090A)
KNOBS = (
    EXPOSURE,
    Knob("white balance", 0x0098090C, 0, 1, 0x0098091A),
    Knob("gain", 0x00980912, 0, 1, 0x00980913),
    FOCUS,
)
RATE_MAY_DROP_ID = 0x009A0903  # longer exposures for fewer pictures a second


def hold_still(
    driver: Driver,
    take: Callable[[], np.ndarray],
    device: Path,
    config: WebcamConfig,
    tell: Callable[[str], None],
) -> None:
    """Let what is automatic settle, then lock it where it is; the focus where it is wanted.

    Parameters
    ----------
    driver
        The camera's controls.
    take
        The next picture, BGR.
    device
        For messages.
    config
        What exposure and focus are wanted.
    tell
        Hears in one line each what does not hold still, and what to do.
    """
    controls = driver.controls()
    knobs = [knob for knob in KNOBS if knob.automatic_id in controls]
    # A lens differs with its focus: that must not be another one each time.
    wanted = {FOCUS: config.focus} | ({EXPOSURE: config.exposure} if config.exposure else {})
    if RATE_MAY_DROP_ID in controls:
        _try_set(driver, controls[RATE_MAY_DROP_ID], 0)
    for knob in knobs:
        if knob not in wanted:
            _try_set(driver, controls[knob.automatic_id], knob.automatic)
    for _ in range(SETTLE_PICTURES):
        take()
    bright = _brightness(take())
    remedies = {}
    for knob in knobs:
        remedies[knob], held = _lock(driver, controls, knob, wanted.get(knob))
        if not held:
            tell(f"camera {device}: its {knob.what} stays automatic; run {_command(device, remedies[knob])}")
    if EXPOSURE not in knobs:
        tell(f"camera {device}: its exposure cannot be locked; keep the light even, or take another camera")
    if bright < DARK_LEVELS:
        tell(f"camera {device}: its picture is dark; uncover the lens or make light, then start again")
        return
    if EXPOSURE in knobs and EXPOSURE not in wanted and EXPOSURE.value_id in controls:
        _match(driver, controls[EXPOSURE.value_id], take, bright, device, tell)
    for _ in range(TAKES_EFFECT_PICTURES):
        take()
    unsteady = _unsteady([take() for _ in range(STEADY_PICTURES)])
    if unsteady:
        everything = ",".join(filter(None, remedies.values()))
        remedy = f"; with nothing moving before it, run {_command(device, everything)}" if everything else ""
        tell(f"camera {device}: {unsteady} though locked{remedy}")


def _lock(driver: Driver, controls: dict[int, Control], knob: Knob, wanted: int | None) -> tuple[str, bool]:
    """(what to set as v4l2-ctl has it, whether it was set and stayed)."""
    automatic, value = controls[knob.automatic_id], controls.get(knob.value_id)
    asked = {automatic: knob.manual}
    if value is not None:
        # What automatic had come to; turning it off alone may go back to a value of long ago.
        asked[value] = _try_get(driver, value) if wanted is None else wanted
        asked[value] = min(max(asked[value], value.lowest), value.highest)
    for control, setting in asked.items():
        _try_set(driver, control, setting)
    # A driver rounds to its steps.
    held = all(
        abs(_try_get(driver, control) - setting) < max(control.step, 1) for control, setting in asked.items()
    )
    return ",".join(f"{control.name}={setting}" for control, setting in asked.items()), held


def _match(
    driver: Driver,
    value: Control,
    take: Callable[[], np.ndarray],
    bright: float,
    device: Path,
    tell: Callable[[str], None],
) -> None:
    """Set the exposure until pictures are as bright as before; not all cameras tell what automatic had."""
    now, setting = bright, _try_get(driver, value)
    for _ in range(MATCH_STEPS):
        for _ in range(TAKES_EFFECT_PICTURES):
            take()
        now = _brightness(take())
        ratio = bright / max(now, 1.0)
        if 1 / ALIKE < ratio < ALIKE:
            return
        # A picture's values go with about the square root of the light.
        setting = round(setting * min(max(ratio**2, 0.25), 4.0))
        setting = min(max(setting, value.lowest, 1), value.highest)
        _try_set(driver, value, setting)
    tell(
        f"camera {device}: with {value.name}={_try_get(driver, value)} its brightness is {now:.0f}, "
        f"automatically {bright:.0f}; set webcam.exposure to try other values, or make more light"
    )


def _unsteady(images: list[np.ndarray]) -> str | None:
    means = [image[::EVERY_PX, ::EVERY_PX].reshape(-1, 3).mean(axis=0) for image in images]
    spread = _spread([float(mean.mean()) for mean in means])
    if spread > STEADY:
        return f"its brightness varies by {100 * spread:.0f} %"
    for channel, name in ((0, "blue"), (2, "red")):
        spread = _spread([float(mean[channel] / max(mean[1], 1.0)) for mean in means])
        if spread > STEADY_COLOUR:
            return f"its {name} varies by {100 * spread:.0f} %"
    return None


def _spread(values: list[float]) -> float:
    """How far the ends of a series are apart, against its median; noise of single pictures counts half."""
    half = len(values) // 2
    first, last = statistics.fmean(values[:half]), statistics.fmean(values[half:])
    middle = max(statistics.median(values), 1e-3)
    return max(abs(last - first), (max(values) - min(values)) / 2) / middle


def _brightness(image: np.ndarray) -> float:
    return float(image[::EVERY_PX, ::EVERY_PX].mean())


def _command(device: Path, settings: str) -> str:
    return f"'v4l2-ctl -d {device} -c {settings}'"


def _try_set(driver: Driver, control: Control, value: int) -> None:
    try:
        driver.set(control, value)
    except OSError:  # what became of it is read back
        return


def _try_get(driver: Driver, control: Control) -> int:
    try:
        return driver.get(control)
    except OSError:
        return control.lowest
