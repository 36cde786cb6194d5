"""Where the robot is: the wheels' way, corrected by what is seen of things that stand still.

A Kalman filter over the place of the axle's middle, the heading, how much larger one wheel is than the other,
how far the wheels really are apart, and a bounded number of landmarks. The wheels move it on; a landmark's
direction and distance correct everything at once: a wheel's size within a metre, and after a turn or a
return the whole way that was driven since the landmark was seen last.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from host.camera.lens import Lens
from host.depth.report import DepthReport, SolvedMotion
from host.nav.config import BodyConfig
from host.nav.landmarks import CLEARLY, UNLIKE, Key, Look, Sighting, recognise, sightings_of
from host.nav.odometry import body_of, heading_of
from host.pose import Pose, wrap
from host.rbdn.snapshot import Snapshot

# the robot's part of the state, BEFORE being its heading a moment ago; landmarks follow, x and z each
X, Z, HEADING, RATIO, TRACK, BEFORE = range(6)
OWN = 6

RATIO_SIGMA = 0.015  # by which one wheel may be larger than the other, unless calibrated
TRACK_SIGMA = 0.03  # by which the wheels may be further apart, as seen by turning
WAY_NOISE = 0.01  # cm per root cm: what wheels on a floor do beyond their sizes
TURN_NOISE = 3e-4  # rad per root cm
TURN_SHARE = 0.005  # of a turn, from frame to frame
WEAR = 1e-5  # per root cm: what a wheel's size, or the track, drifts by
TIME_SIGMA_S = 0.012  # of a frame against the wheels' readings: shifts what is seen while turning

SEEN_TURN_S = 0.1  # turns that the net saw are taken in over at least this long,
SEEN_TURN_SIGMA = 0.0015  # where they were solved at least so well, rad
SEEN_TURN_RAD = 0.003  # by which they are off,
SEEN_TURN_SHARE = 0.06  # and of a turn: rows are exposed one after another
SEEN_TURN_ALIKE = 2e-3  # and for each cm of way: seen turns err alike for decimetres, by up to 4e-4,
ALIKE_OF_FOUR = 4e-3  # and by twice that where four regions show
LEAST_REGIONS = 4  # fewer show at most one thing before what is behind: is it nearer than was thought,
SEEMING_TURN = 2e-3  # that looks like a turn by so much for each cm of way, for as long as it is seen
SLIP_REGIONS = 3  # and fewer may show nothing but that: 3e-2 for each cm
SEEN_TURN_GATE = 9.0  # chi2 beyond which a wheel slipped, and nothing is learnt of the wheels from it
SLIP_DOUBT = 0.3  # of such a turn stays in doubt: what moves may look like it
ROLLS_CM, ROLLING_TURN_SIGMA = 1.0, 0.003  # wheels that roll so far may slip: looks may be so bad
ODD_TURNS, ODD_TURN_SIGMA = 3, 0.01  # looks in a row that show it, and the later ones so bad

STEP_CM, STEP_RAD = 1.5, 0.02  # corrections are made each time the robot has moved so far
GATE = 13.8  # chi2 of two measures beyond which a sighting corrects nothing
ALIKE = 4.0  # sightings err alike for a while: their standard errors count so much more
ALIKE_NEAR = 12.0  # likewise distances
KNOWN_NEAR = 3.0  # but by hardly more than one is the same thing off when it is seen again
MOST_AT_ONCE = 8  # sightings used of one frame
LONE_TURN = 0.02  # rad that one landmark alone may turn the robot by when it is seen again
LANDMARKS = 20  # the most that are kept
PROBATION = 4  # a thing is seen so often before it is believed to stand still
STEADY = 0.015  # rad by which it may be elsewhere from sighting to sighting meanwhile
NEAREST_CM = 5.0
BESIDE = 0.5  # X/Z beyond the picture's border where a landmark may be expected and yet be in view
STRIKES = 6  # so many sightings in a row elsewhere, and it does not
LEAST_NEAR = 1 / 450.0  # 1/cm: what is further away says too little

# a place found again from landmarks alone, wherever the robot may be
SURELY_SEEN = 6  # sightings of each
APART_CM = 30.0  # landmarks nearer to each other tell no direction
FITS_CM, FITS_SHARE = 8.0, 0.1  # by which they may lie otherwise to each other than they did
FOUND_CM, FOUND_RAD = 6.0, 0.06  # standard errors of the place then
KEPT_CM = 8.0  # and of the other landmarks
SAME_CM = 3.0  # by which one that is known again may be seen elsewhere on the thing
ENOUGH = 3  # where they lie nearly where they did, as after a slip: a thing counts 2, an edge 1
ENOUGH_ELSEWHERE = 6  # anywhere else
TRY_AGAIN = 20  # frames later, when nothing new is seen
ENOUGH_PUSHED = 5  # further off than a slip, nearer than elsewhere
SLIPPED_CM, SLIPPED_RAD = 8.0, 0.12  # by so much a robot that slips may be off, two standard errors
SLIPPED_CHI2 = 1.0  # of each coordinate of what is seen elsewhere, up to which that is all
PUSHED_CM, PUSHED_RAD = 40.0, 0.4  # or one that is pushed


@dataclass
class Landmark:
    """What is known of a landmark beside its place."""

    number: int  # never given again
    look: Look
    key: Key | None  # the net's name for it while it is in view
    seen_s: float
    seen: int = 1
    strikes: int = 0
    returns: int = 0  # times it was recognised
    sure: bool = True  # that it is the one in view: it was followed there, or corrected something since


@dataclass(frozen=True)
class _Lost:
    """A landmark that was known before the robot was lost."""

    mark: Landmark
    place_cm: np.ndarray  # (2,) x, z
    covariance: np.ndarray  # (2, 2)


@dataclass
class _Candidate:
    """Something seen that may become a landmark."""

    seen: int
    place_cm: tuple[float, float]  # where it was seen last


@dataclass
class _News:
    """What a sighting says beyond what was expected."""

    chi2: float
    news: np.ndarray  # (2,) across, near
    ph: np.ndarray  # (N, 2) covariance of the state with what is expected
    inverse: np.ndarray  # (2, 2) of the news' covariance

    @property
    def turn_rad(self) -> float:
        """By which it would turn the robot."""
        return float(self.ph[HEADING] @ self.inverse @ self.news)


class Localiser:
    """Feed it every frame's odometry and what was made of the frame; it tells the pose in the map's frame.

    Two frames of reference: ``smooth`` never jumps, and drifts, for what compares a frame with the last ones;
    the pose that ``update`` returns is where the robot is thought to be on the map.
    """

    def __init__(self, body: BodyConfig, lens: Lens) -> None:
        self._body, self._lens = body, lens
        self._ahead = body.camera_ahead_cm
        ends = lens.to_rays(np.array([[0.0, lens.cy], [lens.width - 1.0, lens.cy]]))
        self._most_aside = float(np.abs(ends[:, 0]).max()) + BESIDE  # beyond, all directions seem alike
        self._mean = np.zeros(OWN)
        self._mean[Z] = -self._ahead
        self._looked_s = -math.inf  # last look at a turn, and the heading then in the frame that never jumps
        self._looked_smooth = 0.0
        self._turned = self._turned_variance = 0.0  # as was seen from BEFORE up to there, rad
        self._way_since_cm = 0.0  # BEFORE
        self._regions_since = 0  # as few as some picture has shown
        self._seeming_rad = 0.0  # by which the first of the odd turns may only seem one
        self._before_wheels = 0.0  # standard error then of where they stand in their cells, as a heading
        self._odd: tuple[tuple[float, float], ...] = ()  # turns that no wheel tells of, and variances, since
        self._cov = np.zeros((OWN, OWN))
        self._cov[RATIO, RATIO], self._cov[TRACK, TRACK] = RATIO_SIGMA**2, TRACK_SIGMA**2
        self.landmarks: list[Landmark] = []
        self._candidates: dict[Key, _Candidate] = {}
        self._refused: set[int] = set()  # regions that move
        self._numbers = 0
        self._odometry: Pose | None = None  # last frame's
        self._smooth = Pose.planar(0.0, 0.0, 0.0)
        self._since_cm = self._since_rad = math.inf  # since the last correction
        self._turn_rate = 0.0
        self.corrections = 0
        self._before: list[_Lost] = []
        self._tried: set[int] = set()  # landmarks by which it was last looked for
        self._idle = 0  # frames since
        self.jump_cm = 0.0  # by how much the last update moved the robot on the map; 100 for a radian

    # ---- asking ----

    @property
    def astray(self) -> bool:
        """The robot was put elsewhere, and has not found yet where; poses go on from where it was before."""
        return bool(self._before)

    @property
    def wheel_ratio(self) -> tuple[float, float]:
        """By how much the left wheel is larger than the right, relative to the configuration, and sigma."""
        return float(self._mean[RATIO]), math.sqrt(self._cov[RATIO, RATIO])

    @property
    def sigma(self) -> tuple[float, float]:
        """Standard errors of the place, cm, and of the heading, rad."""
        return math.sqrt(self._cov[X, X] + self._cov[Z, Z]), math.sqrt(self._cov[HEADING, HEADING])

    def landmark_cm(self, index: int) -> np.ndarray:
        """(x, z) of a landmark on the map."""
        return self._mean[OWN + 2 * index : OWN + 2 * index + 2].copy()

    def turn_as_learnt(self, way_cm: float, turn_rad: float) -> tuple[float, float]:
        """What was truly turned where wheels as configured say this, and what the wheels leave open, rad."""
        by_ratio, by_track = way_cm / self._body.track_cm, turn_rad
        variances = self._cov[RATIO, RATIO], self._cov[TRACK, TRACK]
        sigma = math.sqrt(by_ratio**2 * variances[0] + by_track**2 * variances[1])
        return self._as_learnt(way_cm, turn_rad)[1], sigma

    # ---- moving ----

    def move(self, odometry: Pose) -> Pose:
        """The wheels have come to this pose; where that is, in the frame that never jumps."""
        before, self._odometry = self._odometry, odometry
        if before is None:
            self._smooth = odometry
            self._mean[:OWN] = *body_of(odometry, self._ahead), 0.0, 0.0, 0.0
            return odometry
        way, turn = _roll(before, odometry, self._ahead)
        dt = max(odometry.t_s - before.t_s, 1e-3)
        x, z, heading = body_of(self._smooth, self._ahead)
        true_way, true_turn = self._as_learnt(way, turn)
        self._smooth = _camera((*_arc(x, z, heading, true_way, true_turn),), self._ahead, odometry)
        self._predict(way, turn)
        self._turn_rate = true_turn / dt
        self._since_cm += abs(way)
        self._way_since_cm += abs(way)
        self._since_rad += abs(true_turn)
        return self._smooth

    def pose(self) -> Pose:
        """The camera on the map at the last frame moved to."""
        like = self._odometry or Pose.planar(0.0, 0.0, 0.0)
        return _camera((self._mean[X], self._mean[Z], self._mean[HEADING]), self._ahead, like)

    def ahead_of(self, odometry: Pose) -> Pose:
        """Where the camera is on the map when the wheels have come to ``odometry`` since the last frame."""
        if self._odometry is None:
            return odometry
        way, turn = self._as_learnt(*_roll(self._odometry, odometry, self._ahead))
        return _camera(
            _arc(self._mean[X], self._mean[Z], self._mean[HEADING], way, turn), self._ahead, odometry
        )

    def _as_learnt(self, way: float, turn: float) -> tuple[float, float]:
        """What wheels of the sizes learnt did when wheels as configured would have done this."""
        track = self._body.track_cm
        ratio, scale = self._mean[RATIO : TRACK + 1].tolist()
        half = 0.5 * ratio
        return way + half * 0.5 * turn * track, (turn + 2 * half * way / track) * (1 + scale)

    def _predict(self, way: float, turn: float) -> None:
        x, z, heading, ratio, scale = self._mean[: TRACK + 1].tolist()
        track = self._body.track_cm
        true_way, true_turn = self._as_learnt(way, turn)
        middle = heading + true_turn / 2
        s, c = math.sin(middle), math.cos(middle)
        self._mean[: HEADING + 1] = x + true_way * s, z + true_way * c, heading + true_turn
        # derivatives of (x, z, heading) by heading, ratio, track
        by_ratio_way, by_ratio_turn = 0.25 * turn * track, way / track * (1 + scale)
        by_track_turn = turn + ratio * way / track
        dx, dz = true_way * c, -true_way * s
        f = np.array([
            [dx, by_ratio_way * s + dx * by_ratio_turn / 2, dx * by_track_turn / 2],
            [dz, by_ratio_way * c + dz * by_ratio_turn / 2, dz * by_track_turn / 2],
            [0.0, by_ratio_turn, by_track_turn],
        ])  # fmt: skip
        p = self._cov
        p[:RATIO] += f @ p[HEADING:BEFORE]
        p[:, :RATIO] += p[:, HEADING:BEFORE] @ f.T
        length = abs(way)
        p[X, X] += WAY_NOISE**2 * length
        p[Z, Z] += WAY_NOISE**2 * length
        p[RATIO, RATIO] += WEAR**2 * length
        p[TRACK, TRACK] += WEAR**2 * length
        p[HEADING, HEADING] += TURN_NOISE**2 * length + (TURN_SHARE * turn) ** 2

    # ---- seeing ----

    def update(self, snapshot: Snapshot, report: DepthReport, distracted: bool = False) -> Pose:
        """Take in what was made of the frame last moved to; the camera's pose on the map.

        Parameters
        ----------
        distracted : something that moves fills much of the picture: what turns there need not be the robot.
        """
        self.jump_cm = 0.0
        known = {r for r, d in report.regions.items() if d.moving}
        if known:
            self._refuse(known)
        if distracted:
            self._odd = ()
        self._turn_as_seen(None if distracted else report.motion, len(snapshot.regions))
        if self._since_cm < STEP_CM and self._since_rad < STEP_RAD:
            return self.pose()
        self._since_cm = self._since_rad = 0.0
        x, z, heading = self._mean[:RATIO]
        t_s = self._odometry.t_s if self._odometry else 0.0
        seen = sightings_of(snapshot, report, self._lens, self._body.camera_height_cm)
        seen = [s for s in seen if s.near > LEAST_NEAR and not self._refused.intersection(_regions(s.key))]
        here = {region.id for region in snapshot.regions}
        for landmark in self.landmarks:
            if landmark.key is not None and not here.issuperset(_regions(landmark.key)):
                landmark.key = None
        matched, new = self._match(seen)
        if matched:
            self._correct(matched, t_s)
        self._begin(new, t_s, here)
        if self.astray:
            self._find_again()
        now_x, now_z, now_heading = self._mean[:RATIO]
        self.jump_cm = math.hypot(now_x - x, now_z - z) + 100 * abs(now_heading - heading)
        return self.pose()

    def _turn_as_seen(self, motion: SolvedMotion | None, regions: int) -> None:
        """The net saw how far the camera turned since a moment ago: that tells what the wheels are like.

        Where wheels that roll cannot have turned it so, one of them slipped: the turn is the one seen. Where
        few ``regions`` show, a turn is hardly told from something nearer than it was thought to be. That errs
        alike from look to look: nothing is learnt of it. But it does not begin at once, as a slip does.
        """
        m, p, now_s = self._mean, self._cov, self._odometry.t_s if self._odometry else 0.0
        if now_s - self._looked_s < SEEN_TURN_S:
            return
        heading, wheels = heading_of(self._smooth), self._odometry.sigma_rot_rad if self._odometry else 0.0
        seen = [c for c in motion.since if c.since_s == self._looked_s] if motion is not None else []
        odd, self._odd = self._odd, ()
        least = min(regions, self._regions_since)
        begin = ROLLING_TURN_SIGMA if self._way_since_cm > ROLLS_CM else SEEN_TURN_SIGMA
        tells = least >= SLIP_REGIONS and bool(seen)
        if tells and seen[0].sigma_yaw_rad < (ODD_TURN_SIGMA if odd else begin):
            turned = wrap(heading - self._looked_smooth)
            self._turned += turned + seen[0].yaw_rad
            self._turned_variance += (
                SEEN_TURN_RAD**2 + seen[0].sigma_yaw_rad ** 2 + (SEEN_TURN_SHARE * turned) ** 2
            )
            news = self._turned - (m[HEADING] - m[BEFORE])
            noise = self._turned_variance + wheels**2 + self._before_wheels**2
            if not odd:
                self._seeming_rad = SEEMING_TURN * self._way_since_cm if least < LEAST_REGIONS else 0.0
            noise += self._seeming_rad**2
            ph = p[:, HEADING] - p[:, BEFORE]
            total = ph[HEADING] - ph[BEFORE] + noise
            if news * news < SEEN_TURN_GATE * total:
                if seen[0].sigma_yaw_rad < SEEN_TURN_SIGMA and least >= LEAST_REGIONS:
                    alike = SEEN_TURN_ALIKE if least > LEAST_REGIONS else ALIKE_OF_FOUR
                    total += (alike * self._way_since_cm) ** 2
                    p -= np.outer(ph, ph / total)
                    self._shift(ph * (news / total))
            else:
                self._odd = (*odd, (news, noise))
                if len(self._odd) < ODD_TURNS:  # between two edges it may only seem so
                    self._looked_s, self._looked_smooth, self._regions_since = now_s, heading, least
                    return
                self._slipped()
        elif len(odd) > 1:  # no more is seen of it
            self._odd = odd
            self._slipped()
        m[BEFORE] = m[HEADING]
        p[BEFORE] = p[HEADING]
        p[:, BEFORE] = p[:, HEADING]
        self._looked_s, self._looked_smooth, self._before_wheels = now_s, heading, wheels
        self._turned = self._turned_variance = self._way_since_cm = 0.0
        self._regions_since = regions

    def _slipped(self) -> None:
        """A wheel slipped, by which the robot turned otherwise than its wheels say."""
        turn_rad, variance = self._odd[-1]
        self._odd = ()
        self._mean[HEADING] += turn_rad
        way = 0.5 * self._body.track_cm  # that its middle went for each rad of that
        doubt = abs(turn_rad) * np.array([way, way, SLIP_DOUBT])
        self._cov[HEADING, HEADING] += variance
        for at, sigma in zip((X, Z, HEADING), doubt.tolist(), strict=True):
            self._cov[at, at] += sigma * sigma

    def lose_place(self) -> None:
        """The robot is elsewhere than the wheels say: what was known becomes a place to be found again.

        Until then it is taken to have slipped.
        """
        if self._odd:
            self._slipped()
        known = []
        for row, mark in enumerate(self.landmarks):
            at = slice(OWN + 2 * row, OWN + 2 * row + 2)
            if mark.seen >= SURELY_SEEN:
                known.append(_Lost(mark, self._mean[at].copy(), self._cov[at, at].copy()))
        # it may have been lost before: what was known then and is not known anew
        earlier = [one for one in self._before if not any(_same(one, other) for other in known)]
        self._before = [*known, *earlier][:LANDMARKS]
        self._tried, self._idle = set(), 0
        self.landmarks = []
        self._candidates, self._refused = {}, set()
        self._mean = self._mean[:OWN].copy()
        self._cov = self._cov[:OWN, :OWN].copy()
        for at, off in ((X, SLIPPED_CM), (Z, SLIPPED_CM), (HEADING, SLIPPED_RAD)):
            self._cov[at, at] += (off / 2) ** 2
        self._looked_s = -math.inf

    def _find_again(self) -> None:
        """Landmarks seen now that are known from before, and lie to each other as they did, tell where.

        Most who doubt the wheels do so because of a slip, or for nothing: what lies nearly where it did is
        looked for first. Things that look alike lie to each other in many ways alike, and a wrong place is
        worse than going on by the wheels: another place needs more of them, and few that speak against it.
        """
        rows = [row for row, mark in enumerate(self.landmarks) if mark.seen >= SURELY_SEEN]
        sure = {self.landmarks[row].number for row in rows}
        self._idle += 1
        if len(rows) < 2 or (sure == self._tried and self._idle < TRY_AGAIN):
            return
        self._tried, self._idle = sure, 0
        near = np.array([
            [math.dist(self.landmark_cm(row), one.place_cm) < self._pushed_cm(one.place_cm)
             for one in self._before]
            for row in rows
        ], dtype=bool).reshape(len(rows), len(self._before))  # fmt: skip
        pairs, now, then, fits, worth = self._compare_places(rows, self._before, near)
        fitting = [pair for pair, fit in zip(pairs, fits.tolist(), strict=True) if fit]
        wanted = ENOUGH if self._as_slipped(fitting) else self._enough(now[fits], then[fits])
        if worth < wanted:
            pairs, now, then, fits, worth = self._compare_places(rows, self._before, np.ones_like(near))
            if worth < ENOUGH_ELSEWHERE or fits.sum() < 3 or 3 * fits.sum() < 2 * len(fits):
                return
            wanted = math.inf  # no slip explains it: it is elsewhere
        if worth >= wanted == ENOUGH:
            self._meet(fitting)
        else:
            self._change_frame(now[fits], then[fits])
        gone = {k for _, k in pairs}
        for k, one in enumerate(self._before):
            if k not in gone and len(self.landmarks) < LANDMARKS:
                self._append(one.place_cm, KEPT_CM**2 * np.eye(2), np.zeros((2, len(self._mean))))
                one.mark.key, one.mark.strikes = None, 0
                self.landmarks.append(one.mark)
        self._before = []

    def _as_slipped(self, pairs: list[tuple[int, int]]) -> bool:
        """Whether a slip, and how well distances are known, explain that things are seen elsewhere."""
        if not pairs:
            return False
        at = np.array([OWN + 2 * row + axis for row, _ in pairs for axis in (0, 1)])
        off = np.concatenate([self._before[k].place_cm for _, k in pairs]) - self._mean[at]
        total = self._cov[np.ix_(at, at)] + SAME_CM**2 * np.eye(len(at))
        for n, (_, k) in enumerate(pairs):
            total[2 * n : 2 * n + 2, 2 * n : 2 * n + 2] += self._before[k].covariance
        return float(off @ np.linalg.solve(total, off)) < SLIPPED_CHI2 * len(at)

    def _meet(self, pairs: list[tuple[int, int]]) -> None:
        """Landmarks (row, index) are what was known before: all that was seen from here goes with them."""
        m, p = self._mean, self._cov
        for row, k in pairs:
            at, lost = slice(OWN + 2 * row, OWN + 2 * row + 2), self._before[k]
            gain = p[:, at] @ np.linalg.inv(p[at, at] + lost.covariance + SAME_CM**2 * np.eye(2))
            p -= gain @ p[at]
            self._shift(gain @ (lost.place_cm - m[at]))

    def _pushed_cm(self, place_cm: np.ndarray) -> float:
        """So far from where it was may something seem to be after a slip or a push."""
        return PUSHED_CM + PUSHED_RAD * math.dist(place_cm, self._mean[:HEADING])

    def _enough(self, now: np.ndarray, then: np.ndarray) -> float:
        """How much must speak for places being others: the more, the further that moves the robot."""
        if len(now) == 0:
            return math.inf
        turn, middle, target = _turn_between(now, then)
        c, s = math.cos(turn), math.sin(turn)
        own = self._mean[:HEADING]
        off_cm = math.dist(target + np.array([[c, s], [-s, c]]) @ (own - middle), own)
        if abs(turn) < SLIPPED_RAD and off_cm < SLIPPED_CM:
            return ENOUGH
        return ENOUGH_PUSHED if abs(turn) < PUSHED_RAD and off_cm < PUSHED_CM else math.inf

    def _compare_places(self, rows: list[int], known: list[_Lost], may: np.ndarray):
        """Landmarks that look like known ones: (row, index) pairs, places now and then, which fit, worth.

        ``may`` (rows, known) says which come into question.
        """
        unlike = np.array([
            [self.landmarks[row].look.unlike(one.mark.look) for one in known] for row in rows
        ]).reshape(len(rows), len(known))  # fmt: skip
        unlike[~may] = np.inf
        pairs = [(rows[i], k) for i, k in recognise(unlike).items()]
        now = np.array([self.landmark_cm(row) for row, _ in pairs]).reshape(-1, 2)
        then = np.array([known[k].place_cm for _, k in pairs]).reshape(-1, 2)
        counts = np.array([len(known[k].mark.look.colours) for _, k in pairs])  # 1 of a thing, 2 of an edge
        fits = _fitting(now, then)
        return pairs, now, then, fits, int((3 - counts[fits]).sum()) if len(pairs) else 0

    def _change_frame(self, now: np.ndarray, then: np.ndarray) -> None:
        """Turn and shift everything so that places (N, 2) come to lie on others."""
        turn, middle, target = _turn_between(now, then)
        n, m = len(self._mean), self._mean
        c, s = math.cos(turn), math.sin(turn)
        rotate = np.array([[c, s], [-s, c]])  # of (x, z); headings grow from z towards x
        whole = np.eye(n)
        by_turn = np.zeros((n, 3))  # by x, z and turn of the frame
        for at in (X, *range(OWN, n, 2)):
            m[at : at + 2] = target + rotate @ (m[at : at + 2] - middle)
            whole[at : at + 2, at : at + 2] = rotate
            dx, dz = m[at : at + 2] - target
            by_turn[at], by_turn[at + 1] = (1.0, 0.0, dz), (0.0, 1.0, -dx)
        m[HEADING] += turn
        m[BEFORE] += turn
        by_turn[HEADING, 2] = by_turn[BEFORE, 2] = 1.0
        frame = np.diag([FOUND_CM**2, FOUND_CM**2, FOUND_RAD**2])
        self._cov = whole @ self._cov @ whole.T + by_turn @ frame @ by_turn.T

    def _refuse(self, regions: set[int]) -> None:
        """What moves by itself is no landmark."""
        self._refused |= regions
        for index in reversed(range(len(self.landmarks))):
            key = self.landmarks[index].key
            if key is not None and regions.intersection(_regions(key)):
                self._forget(index)

    def _match(self, seen: list[Sighting]) -> tuple[list[tuple[Sighting, int]], list[Sighting]]:
        """(sightings with their landmarks' rows, sightings of nothing known)."""
        followed = {mark.key: row for row, mark in enumerate(self.landmarks) if mark.key is not None}
        matched, rest = [], []
        for sighting in seen:
            row = followed.get(sighting.key)
            if row is not None and sighting.look.unlike(self.landmarks[row].look) < UNLIKE:
                matched.append((sighting, row))
            elif row is None:
                rest.append(sighting)
        free = [row for row, mark in enumerate(self.landmarks) if mark.key is None]
        if not rest or not free:
            return matched, rest
        unlike = np.full((len(rest), len(free)), np.inf)
        for i, sighting in enumerate(rest):
            for k, row in enumerate(free):
                looks = sighting.look.unlike(self.landmarks[row].look)
                if looks < UNLIKE + CLEARLY:
                    unlike[i, k] = looks + self._out_of_place(sighting, row)
        found = recognise(unlike)
        new = []
        for i, sighting in enumerate(rest):
            if i in found:
                row = free[found[i]]
                self.landmarks[row].key = sighting.key
                self.landmarks[row].returns += 1
                self.landmarks[row].sure = False
                matched.append((sighting, row))
            elif not unlike.shape[1] or unlike[i].min() > UNLIKE + CLEARLY:
                new.append(sighting)
        return matched, new

    def _out_of_place(self, sighting: Sighting, row: int) -> float:
        """Chi2 of a sighting that would be this landmark's."""
        found = self._compare(sighting, row, KNOWN_NEAR)
        return math.inf if found is None else found.chi2

    def _compare(self, sighting: Sighting, row: int, alike_near: float = ALIKE_NEAR) -> _News | None:
        """What a sighting says beyond what was expected of a landmark; None where that cannot be in view.

        Distances count with ``alike_near`` of their standard errors.
        """
        p, at = self._cov, OWN + 2 * row
        own_x, own_z, heading = self._mean[: HEADING + 1].tolist()
        x, z = self._mean[at : at + 2].tolist()
        sine, cosine = math.sin(heading), math.cos(heading)
        dx, dz = x - own_x - self._ahead * sine, z - own_z - self._ahead * cosine
        depth, side = dx * sine + dz * cosine, dx * cosine - dz * sine
        if depth < NEAREST_CM or abs(side) > self._most_aside * depth:
            return None
        u, w = side / depth, 1 / depth
        # derivatives of across and near by the landmark's x and z; those by the robot's are their opposite
        across_x, across_z = w * (cosine - u * sine), w * (-sine - u * cosine)
        near_x, near_z = -w * w * sine, -w * w * cosine
        turned = -w * (depth + self._ahead) - u * u  # and by the heading
        own = np.array([[-across_x, -across_z, turned], [-near_x, -near_z, -w * u]])
        its = np.array([[across_x, across_z], [near_x, near_z]])
        ph = p[:, : HEADING + 1] @ own.T + p[:, at : at + 2] @ its.T
        s = own @ ph[: HEADING + 1] + its @ ph[at : at + 2]
        (a, b), (_, d) = s.tolist()
        noise = self._noise(sighting, alike_near)
        a, d = a + noise[0], d + noise[1]
        inverse = np.array([[d, -b], [-b, a]]) / (a * d - b * b)
        news = np.array([sighting.across - u, sighting.near - w])
        return _News(float(news @ inverse @ news), news, ph, inverse)

    def _noise(self, sighting: Sighting, alike_near: float = ALIKE_NEAR) -> tuple[float, float]:
        """Variances of what is measured, as far as it counts as news."""
        timing = TIME_SIGMA_S * self._turn_rate * (1 + sighting.across**2)
        wheels = self._odometry.sigma_rot_rad if self._odometry else 0.0
        across = (ALIKE * sighting.sigma_across) ** 2 + timing**2 + wheels**2
        return across, (alike_near * sighting.sigma_near) ** 2

    def _correct(self, matched: list[tuple[Sighting, int]], t_s: float) -> None:
        """One step of the filter for every sighting that is where it may be.

        A heading in doubt leaves room for many things, and one taken for another would turn the robot's whole
        world. A landmark that is seen again, and would turn it further than the same thing may seem off when
        it is seen from elsewhere, waits for another one that says the same.
        """
        waiting = []
        for pair in sorted(matched[:MOST_AT_ONCE], key=lambda pair: not self.landmarks[pair[1]].sure):
            mark, found = self.landmarks[pair[1]], self._compare(*pair)
            if found is None or found.chi2 > GATE:
                mark.strikes += 1
            elif mark.sure or abs(found.turn_rad) < LONE_TURN:
                self._learn(*pair, found, t_s)
            else:
                waiting.append(pair)
        for one in waiting:
            agreeing = self._agreeing(one, [pair for pair in waiting if pair is not one])
            if agreeing:
                for pair in (one, *agreeing):
                    found = self._compare(*pair)
                    if found is not None:
                        self._learn(*pair, found, t_s)
                break
        for index in reversed(range(len(self.landmarks))):
            if self.landmarks[index].strikes >= STRIKES:
                self._forget(index)

    def _agreeing(
        self, one: tuple[Sighting, int], others: list[tuple[Sighting, int]]
    ) -> list[tuple[Sighting, int]]:
        """Sightings that are where they should be, and would turn the robot but little, were one believed."""
        found = self._compare(*one)
        if found is None or not others:
            return []
        kept = self._mean.copy(), self._cov.copy()
        self._correct_by(found)
        then = [self._compare(*other) for other in others]
        self._mean, self._cov = kept
        return [
            other
            for other, found in zip(others, then, strict=True)
            if found is not None and found.chi2 <= GATE and abs(found.turn_rad) < LONE_TURN
        ]

    def _learn(self, sighting: Sighting, row: int, found: _News, t_s: float) -> None:
        mark = self.landmarks[row]
        self._correct_by(found)
        mark.sure = True
        mark.strikes = 0
        mark.seen += 1
        mark.seen_s = t_s
        mark.look = mark.look.with_more(sighting.look, 0.05)
        self.corrections += 1

    def _correct_by(self, found: _News) -> None:
        gain = found.ph @ found.inverse
        self._cov -= gain @ found.ph.T
        self._shift(gain @ found.news)

    def _shift(self, by: np.ndarray) -> None:
        """Correct the state, (N,), and let a wrong heading still turn all places about one point as before.

        Nothing that is seen from a place tells how the map as a whole lies. Were each place's error by the
        heading left as it was for the place it is moved from, the next sightings would seem to tell just
        that: small errors of distances then turn all of a robot whose heading is in doubt.
        """
        self._mean += by
        lever = np.zeros(len(by))
        lever[X], lever[Z] = by[Z], -by[X]
        lever[OWN::2], lever[OWN + 1 :: 2] = by[OWN + 1 :: 2], -by[OWN::2]
        self._cov += np.outer(lever, self._cov[HEADING])
        self._cov += np.outer(self._cov[:, HEADING], lever)

    # ---- landmarks come and go ----

    def _begin(self, new: list[Sighting], t_s: float, here: set[int]) -> None:
        self._candidates = {k: c for k, c in self._candidates.items() if here.issuperset(_regions(k))}
        self._refused &= here
        for sighting in new:
            candidate = self._candidates.get(sighting.key)
            place = self._place_of(sighting)
            steady = candidate is not None and self._is_at(sighting, candidate.place_cm)
            seen = 1 + (candidate.seen if candidate is not None and steady else 0)
            self._candidates[sighting.key] = _Candidate(seen, place)
            if seen >= PROBATION:
                del self._candidates[sighting.key]
                self._add(sighting, t_s)

    def _place_of(self, sighting: Sighting) -> tuple[float, float]:
        """(x, z) on the map of what is seen."""
        sine, cosine = math.sin(self._mean[HEADING]), math.cos(self._mean[HEADING])
        depth = 1 / sighting.near
        ahead, side = self._ahead + depth, sighting.across * depth
        return (
            float(self._mean[X]) + ahead * sine + side * cosine,
            float(self._mean[Z]) + ahead * cosine - side * sine,
        )

    def _is_at(self, sighting: Sighting, place_cm: tuple[float, float]) -> bool:
        """Whether it is seen in the direction of a place."""
        sine, cosine = math.sin(self._mean[HEADING]), math.cos(self._mean[HEADING])
        dx = place_cm[0] - self._mean[X] - self._ahead * sine
        dz = place_cm[1] - self._mean[Z] - self._ahead * cosine
        depth, side = dx * sine + dz * cosine, dx * cosine - dz * sine
        return depth > NEAREST_CM and abs(side / depth - sighting.across) < STEADY

    def _add(self, sighting: Sighting, t_s: float) -> None:
        if len(self.landmarks) >= LANDMARKS:
            self._forget(min(range(len(self.landmarks)), key=lambda k: self.landmarks[k].seen_s))
        m, n = self._mean, len(self._mean)
        sine, cosine = math.sin(m[HEADING]), math.cos(m[HEADING])
        depth = 1 / sighting.near
        side = sighting.across * depth
        ahead, u = self._ahead + depth, sighting.across
        x, z = self._place_of(sighting)
        by_own = np.zeros((2, n))
        by_own[0, X] = by_own[1, Z] = 1.0
        by_own[:, HEADING] = ahead * cosine - side * sine, -ahead * sine - side * cosine
        by_seen = np.array([
            [depth * cosine, -depth * depth * (sine + u * cosine)],
            [-depth * sine, -depth * depth * (cosine - u * sine)],
        ])  # fmt: skip
        shared = by_own @ self._cov
        own = np.diag([self._noise(sighting)[0], sighting.sigma_near**2])
        self._append(np.array([x, z]), shared @ by_own.T + by_seen @ own @ by_seen.T, shared)
        self._numbers += 1
        self.landmarks.append(Landmark(self._numbers, sighting.look, sighting.key, t_s))

    def _append(self, place_cm: np.ndarray, own: np.ndarray, shared: np.ndarray) -> None:
        """Add a place to the state: its covariance (2, 2) and what it shares with the rest (2, N)."""
        n = len(self._mean)
        cov = np.empty((n + 2, n + 2))
        cov[:n, :n], cov[n:, :n], cov[:n, n:], cov[n:, n:] = self._cov, shared, shared.T, own
        self._mean, self._cov = np.append(self._mean, place_cm), cov

    def _forget(self, index: int) -> None:
        gone = [OWN + 2 * index, OWN + 2 * index + 1]
        self._mean = np.delete(self._mean, gone)
        self._cov = np.delete(np.delete(self._cov, gone, axis=0), gone, axis=1)
        del self.landmarks[index]


def _same(one: _Lost, other: _Lost) -> bool:
    near = math.dist(one.place_cm, other.place_cm) < APART_CM
    return near and one.mark.look.unlike(other.mark.look) < UNLIKE


def _fitting(now: np.ndarray, then: np.ndarray) -> np.ndarray:
    """(N,) bool, the most places that lie to each other as others do; none where no two of them do."""
    best = np.zeros(len(now), bool)
    for i in range(len(now)):
        for k in range(i):
            length, before = np.linalg.norm(now[i] - now[k]), np.linalg.norm(then[i] - then[k])
            if min(length, before) < APART_CM or abs(length - before) > FITS_CM + FITS_SHARE * before:
                continue
            turn, middle, target = _turn_between(now[[i, k]], then[[i, k]])
            c, s = math.cos(turn), math.sin(turn)
            moved = target + (now - middle) @ np.array([[c, s], [-s, c]]).T
            off = np.linalg.norm(moved - then, axis=1)
            fits = off < FITS_CM + FITS_SHARE * np.linalg.norm(then - target, axis=1)
            if fits.sum() > best.sum():
                best = fits
    return best


def _turn_between(now: np.ndarray, then: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
    """Turn, rad to the right, and middles (2,) of places (N, 2) before and after; least squares."""
    middle, target = now.mean(axis=0), then.mean(axis=0)
    a, b = now - middle, then - target
    turn = math.atan2(float((a[:, 1] * b[:, 0] - a[:, 0] * b[:, 1]).sum()), float((a * b).sum()))
    return turn, middle, target


def _regions(key: Key) -> tuple[int, ...]:
    return key if isinstance(key, tuple) else (key,)


def _camera(axle: tuple[float, float, float], ahead_cm: float, like: Pose) -> Pose:
    x, z, heading = (float(v) for v in axle)
    return Pose.planar(
        x + ahead_cm * math.sin(heading),
        z + ahead_cm * math.cos(heading),
        heading,
        t_s=like.t_s,
        sigma_z_cm=like.sigma_z_cm,
        sigma_rot_rad=like.sigma_rot_rad,
    )


def _roll(before: Pose, after: Pose, ahead_cm: float) -> tuple[float, float]:
    """(way of the axle's middle in cm, turn in rad) between two poses of a rolling robot."""
    xa, za, ha = body_of(before, ahead_cm)
    xb, zb, hb = body_of(after, ahead_cm)
    turn = wrap(hb - ha)
    middle = ha + turn / 2
    chord = (xb - xa) * math.sin(middle) + (zb - za) * math.cos(middle)
    return chord, turn


def _arc(x: float, z: float, heading: float, way: float, turn: float) -> tuple[float, float, float]:
    middle = heading + turn / 2
    return x + way * math.sin(middle), z + way * math.cos(middle), heading + turn
