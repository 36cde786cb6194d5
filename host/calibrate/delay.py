"""By how much pictures are stamped later than they are exposed, measured with turns to and fro."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from host.config import Config
from host.errors import EXIT_DONE, InputError, UsageError

if TYPE_CHECKING:
    from host.calibrate.turning import Delay

WORST_SIGMA_S = 0.006


@dataclass(frozen=True)
class DelayOptions:
    """Measure by how much pictures are stamped too late, from turns to and fro on the spot."""

    camera: str = "sim:room?seed=1"  # a webcam's number or device; in simulation a room
    robot: str = "sim:"  # a port such as /dev/ttyACM0, or auto; in simulation sim:
    lens: Path | None = None  # camera.json of a real camera
    sweeps: int = 6  # turns each way, fast and slow each
    save: bool = False  # write the result into robot.toml

    def __post_init__(self) -> None:
        if not 2 <= self.sweeps <= 100:
            raise UsageError(f"--sweeps must be from 2 to 100, not {self.sweeps}")


def measure(options: DelayOptions, config: Config) -> Delay:
    """Open everything, turn to and fro, and reckon."""
    # Here, so that --help need not wait for it.
    from host.calibrate.ride import ride, sizes_of
    from host.calibrate.turning import motions, solve
    from host.nav.rig import open_rig

    turns = motions(options.sweeps)
    what = (
        "The robot turns on the spot to and fro, 40 degrees to each side, for about "
        f"{sum(one.lasts_s for one in turns) / 3:.0f} s. Let it stand free, in view of things with edges."
    )
    as_stamped = replace(config.webcam, late_s=0.0)
    with open_rig(options.camera, options.robot, options.lens, webcam=as_stamped) as rig:
        return solve(ride(rig, turns, sizes_of(config.body), what), config.body)


def run(options: DelayOptions, config: Config) -> int:
    """The command's body; 3 where too little was to be seen."""
    from host.calibrate.keep import check_keepable, tell

    check_keepable(options.save)
    found = measure(options, config)
    late_ms, sigma_ms = 1e3 * found.late_s, 1e3 * found.sigma_s
    print(
        f"Pictures are stamped {late_ms:.1f} ± {sigma_ms:.1f} ms after the exposure of their middle row "
        f"(set now: {1e3 * config.webcam.late_s:.1f} ms); {found.pairs} pairs of pictures."
    )
    print(
        f"Rows are exposed within {1e3 * max(found.readout_s, 0.0):.0f} ms; the wheels' play turns the robot "
        f"by {math.degrees(abs(found.play_rad)):.2f} degrees."
    )
    if found.sigma_s > WORST_SIGMA_S:
        raise InputError(
            f"± {sigma_ms:.1f} ms is too little to go by: more --sweeps, less slip, more to be seen"
        )
    tell({"webcam": {"late_s": round(found.late_s, 4)}}, options.save)
    return EXIT_DONE
