"""The robot's measures, and how carefully it drives."""

from __future__ import annotations

from dataclasses import dataclass

from host.ranges import check_ranges

BODY_RANGES = {
    "cm_per_count": (0.01, 4.0),  # as the firmware's parameters, and so the track
    "track_cm": (2.0, 100.0),
    "wheel_ratio": (0.5, 2.0),
    "size_sigma": (0.0, 0.5),
    "ratio_sigma": (0.0, 0.5),
    "track_sigma": (0.0, 0.5),
    "radius_cm": (1.0, 200.0),
    "camera_height_cm": (1.0, 200.0),
    "camera_ahead_cm": (0.0, 200.0),
}


@dataclass(frozen=True)
class BodyConfig:
    """Geometry of the robot. The body is a disc around the middle of its axle."""

    cm_per_count: float = 0.5  # travel of a wheel from one encoder edge to the next
    track_cm: float = 15.0  # distance between the wheels' contact points
    wheel_ratio: float = 1.0  # left wheel over right, as far as it is known; a drive goes on learning it
    size_sigma: float = 0.01  # standard error of the wheels' mean size, relative
    ratio_sigma: float = 0.02  # of their ratio
    track_sigma: float = 0.02  # of the track, relative
    radius_cm: float = 12.0  # of the disc that holds the whole robot
    camera_height_cm: float = 15.0  # lens above the floor
    camera_ahead_cm: float = 12.0  # lens in front of the axle's middle

    def __post_init__(self) -> None:
        check_ranges(self, BODY_RANGES)


MOST_CELLS = 400  # from the middle of the map to its edge
MOST_REACTION_S = 10.0
NAV_RANGES = {
    "clearance_cm": (0.1, 100.0),
    "comfort_cm": (0.0, 200.0),
    "speed_cm_s": (1.0, 100.0),
    "creep_cm_s": (1.0, 100.0),
    "turn_rad_s": (0.05, 6.0),
    "brake_cm_s2": (1.0, 1000.0),
    "reaction_s": (0.0, MOST_REACTION_S),
    "piece_cm": (1.0, 1000.0),
    "goal_tolerance_cm": (0.5, 500.0),
    "give_up_s": (0.1, 600.0),
    # Above these the robot would drive on what it no longer knows.
    "frame_stale_s": (0.01, 0.3),
    "link_stale_s": (0.01, 0.25),
    "map_half_cm": (50.0, 10000.0),
    "cell_cm": (0.5, 50.0),
    "memory_s": (1.0, 100000.0),
}


@dataclass(frozen=True)
class NavConfig:
    """How the robot drives. Distances from the robot's rim where nothing else is said."""

    clearance_cm: float = 4.0  # nearest the rim may come to anything while driving towards it
    comfort_cm: float = 12.0  # ways that keep this much room are preferred
    speed_cm_s: float = 20.0  # over floor that was seen to be free
    creep_cm_s: float = 8.0  # over floor not seen yet, to give depth its baseline
    turn_rad_s: float = 0.5  # turning in place
    brake_cm_s2: float = 40.0  # deceleration counted on
    reaction_s: float = 0.2  # from capture of a frame to the first effect on the wheels
    piece_cm: float = 20.0  # a straight piece is at least this long, unless something is in the way
    goal_tolerance_cm: float = 10.0  # the camera this near to the goal has reached it
    give_up_s: float = 6.0  # without any way for this long, after looking around: blocked
    frame_stale_s: float = 0.3  # no motion on a picture older than this
    link_stale_s: float = 0.25  # no motion on telemetry older than this
    map_half_cm: float = 400.0  # the map reaches this far from the start on every side
    cell_cm: float = 5.0  # side of a map cell
    memory_s: float = 60.0  # evidence fades to 1/e in this time

    def __post_init__(self) -> None:
        check_ranges(self, NAV_RANGES)
        if self.creep_cm_s > self.speed_cm_s:
            raise ValueError(f"creep_cm_s = {self.creep_cm_s} is over speed_cm_s = {self.speed_cm_s}")
        if self.map_half_cm / self.cell_cm > MOST_CELLS:
            raise ValueError(
                f"map_half_cm = {self.map_half_cm} is over {MOST_CELLS} cells of cell_cm = {self.cell_cm}"
            )
