"""Where the four edges of an encoder's cycle truly lie, learnt while the wheel turns evenly.

Two channels make four edges a cycle, and the same four come again with every cycle. They would be a count
apart if the channels were a quarter of a cycle apart and as long high as low, which cheap sensors are not.
While a wheel turns evenly, the times of the edges within a whole cycle tell their places.
"""

from __future__ import annotations

from collections import deque

CYCLE = 4  # edges
EVEN = 0.05  # two whole cycles whose times differ by less than this part are turned evenly
LEAST_GAIN = 0.03  # of what an edge says, once many have been heard
OFF_MAX = 0.7  # counts; further off, edges would change their order


class Marks:
    """The places of one encoder's edges, in counts."""

    def __init__(self) -> None:
        self._off = [0.0] * CYCLE  # from where they would be if all were a count apart
        self._edges: deque[tuple[float, int]] = deque(maxlen=CYCLE + 1)  # of one direction: time, border
        self._cycle_s: float | None = None  # the last whole cycle took
        self._learnt = 0

    def place(self, border: int) -> float:
        """Where the edge between count ``border - 1`` and count ``border`` is."""
        return border + self._off[border % CYCLE]

    def forget(self) -> None:
        """The counts no longer mean what they did."""
        self._off = [0.0] * CYCLE
        self._learnt = 0
        self._begin()

    def hear(self, t_s: float, border: int) -> None:
        """An edge at a time; the ones in between may have been missed."""
        edges = self._edges
        if edges:
            step = border - edges[-1][1]
            forward = len(edges) < 2 or (edges[-1][1] > edges[-2][1]) == (step > 0)
            if step == 0 or not forward or t_s <= edges[-1][0]:
                self._begin()
        edges.append((t_s, border))
        while abs(border - edges[0][1]) > CYCLE:
            edges.popleft()
        if abs(border - edges[0][1]) == CYCLE:
            self._learn()

    def _begin(self) -> None:
        self._edges.clear()
        self._cycle_s = None

    def _learn(self) -> None:
        (first_s, first), (last_s, last) = self._edges[0], self._edges[-1]
        cycle_s, before_s = last_s - first_s, self._cycle_s
        self._cycle_s = cycle_s
        if before_s is None or abs(cycle_s - before_s) > EVEN * before_s:
            return
        gain = max(LEAST_GAIN, 1.0 / (2 + self._learnt))
        self._learnt += 1
        off, a = self._off, first % CYCLE
        for t_s, border in list(self._edges)[1:-1]:
            b = border % CYCLE
            place = first + (last - first) * (t_s - first_s) / cycle_s  # if the first edge were on its place
            error = place - border - (off[b] - off[a])
            off[a] -= gain * error / 2
            off[b] += gain * error / 2
        mean = sum(off) / CYCLE
        self._off = [min(max(one - mean, -OFF_MAX), OFF_MAX) for one in off]
