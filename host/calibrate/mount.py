"""How the camera sits on the robot: its height above the floor and where it looks, from a straight drive."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from host.config import Config
from host.errors import EXIT_DONE, InputError, UsageError

if TYPE_CHECKING:
    from host.calibrate.flow import Mount

SPEED_MM_S = 100.0
WORST_HEIGHT, WORST_RAD = 0.04, 0.02  # sigmas beyond which nothing is told
MOST_CHANGE = 0.2  # of the height that is set: as far as is looked to begin with


@dataclass(frozen=True)
class MountOptions:
    """Measure the camera's height and tilt from a straight drive over a floor with some texture."""

    camera: str = "sim:room?seed=1"  # a webcam's number or device; in simulation a room
    robot: str = "sim:"  # a port such as /dev/ttyACM0, or auto; in simulation sim:, as in sim:?nod=2&raised=1
    lens: Path | None = None  # camera.json of a real camera
    way_cm: float = 50.0  # driven straight on, blindly
    save: bool = False  # write the height into robot.toml

    def __post_init__(self) -> None:
        if not 20 <= self.way_cm <= 300:
            raise UsageError(f"--way-cm must be from 20 to 300, not {self.way_cm:g}")


def measure(options: MountOptions, config: Config) -> Mount:
    """Open everything, drive, and reckon."""
    # Here, so that --help need not wait for it.
    from host.calibrate.flow import shots, solve
    from host.calibrate.ride import Drive, ride, sizes_of
    from host.nav.rig import open_rig

    what = (
        f"The robot drives {options.way_cm:g} cm straight on, blindly. Let its way be free, and the floor "
        "have a pattern."
    )
    straight = Drive(SPEED_MM_S, 0.0, 3 * 10 * options.way_cm / SPEED_MM_S, way_mm=10 * options.way_cm)
    with open_rig(options.camera, options.robot, options.lens, webcam=config.webcam) as rig:
        seen = shots(ride(rig, [straight], sizes_of(config.body), what), config.body)
    return solve(seen, config.body.camera_height_cm)


def sentences(found: Mount, config: Config) -> list[str]:
    """What a person should know of it."""
    from host.calibrate.flow import LEVEL_RAD

    height, pitch, roll, yaw = found.sigmas
    deg = math.degrees

    def way(angle: float, more: str, less: str) -> str:
        return f"{abs(deg(angle)):.2f} degrees {more if angle > 0 else less}"

    out = [
        f"The lens is {found.height_cm:.2f} ± {height:.2f} cm above the floor (set now: "
        f"{config.body.camera_height_cm:g}).",
        f"It looks {way(found.pitch, 'down', 'up')} (± {deg(pitch):.2f}), "
        f"{way(found.yaw, 'right', 'left')} of where the robot drives to (± {deg(yaw):.2f}), and leans "
        f"{way(found.roll, 'right', 'left')} (± {deg(roll):.2f}).",
        f"The floor's pattern is alike from picture to picture to {100 * found.likeness:.0f} %.",
    ]
    if not found.level:
        out.append(
            "The program takes the camera to be level: turn it by these angles until they are below "
            f"{deg(LEVEL_RAD):g} degrees, then measure again; a degree is worth 7 % of a depth of 60 cm on "
            "the floor."
        )
    return out


def run(options: MountOptions, config: Config) -> int:
    """The command's body; 3 where too little of the floor was to be seen, or what comes out is not likely."""
    from host.calibrate.keep import check_keepable, tell

    check_keepable(options.save)
    found = measure(options, config)
    for line in sentences(found, config):
        print(line)
    if found.sigmas[0] > WORST_HEIGHT * found.height_cm or max(found.sigmas[1:3]) > WORST_RAD:
        raise InputError(
            "that is too little to go by: drive further (--way-cm), over a floor with more pattern"
        )
    if abs(found.height_cm / config.body.camera_height_cm - 1) > MOST_CHANGE:
        height_cm = config.body.camera_height_cm
        raise InputError(
            f"{found.height_cm:.1f} cm is far from the {height_cm:g} that are set, and a bare floor can "
            "mislead: measure with a ruler, set --body.camera-height-cm to that, and try again"
        )
    tell({"body": {"camera_height_cm": round(found.height_cm, 2)}}, options.save)
    return EXIT_DONE
