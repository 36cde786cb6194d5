"""The nearer thing owns an edge; what is hidden or cut uses what is its own, or declines."""

from __future__ import annotations

from drives import ahead, drive, wall
from solid_scene import Eye, board


def test_a_board_seen_through_a_gap_is_not_read_at_the_gaps_depth():
    # two near boards leave a gap; what is seen of the far one is bounded by them left and right
    near = [board(10, (-16, 0, 60), (20, 36)), board(11, (16, 0, 60), (20, 36))]
    far = board(12, (0, 0, 130), (60, 30))
    for seed in range(8):
        run = drive(Eye([*near, far, wall()], noise_px=0.1, seed=seed), ahead(11, 10.0))
        for piece in (name for name in run.last.regions if name % 1000 == 12):
            depth = run.region(piece).depth_cm
            assert depth is None or abs(depth / 120 - 1) < 0.08
