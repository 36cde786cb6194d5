"""Which tests run on one processor, and a small sequence folder that tests may break."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

# What shares something that takes long to build, and what is timed by the clock: of that never two at once.
TOGETHER = {
    "firmware": ("firmware/",),
    "clock": ("link/", "camera/", "loop/test_real_parts", "sim/test_serve", "view/test_page"),
    "depth": ("depth/",),
    "calibrate": ("calibrate/",),
    "record": ("record/",),
}
WIDTH, HEIGHT, FOCAL = 96, 72, 110.0
GAMMA = 2.2


def group_of(nodeid: str) -> str:
    """Whose tests one process runs: one of TOGETHER, or a file."""
    file = nodeid.split("::")[0].removeprefix("tests/")
    return next((group for group, files in TOGETHER.items() if file.startswith(files)), file)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log):
    """For `make test`, which runs two processes."""
    from xdist.scheduler import LoadScopeScheduling

    class Together(LoadScopeScheduling):
        def _split_scope(self, nodeid: str) -> str:
            return group_of(nodeid)

    return Together(config, log)


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """There, what takes longest begins."""
    if hasattr(config, "workerinput"):
        order = {group: k for k, group in enumerate(TOGETHER)}
        items.sort(key=lambda item: order.get(group_of(item.nodeid), len(order)))


def small_image(z_cm: float) -> np.ndarray:
    """A red square of 20 cm, 60 cm from the start, on a grey wall; seen from z_cm. (72, 96, 3) BGR."""
    half = FOCAL * 10 / (60 - z_cm)
    # Share of each column and row that the square covers; OpenCV's own shapes are half a pixel too wide.
    across = np.clip(half + 0.5 - np.abs(np.arange(WIDTH) - (WIDTH - 1) / 2), 0, 1)
    down = np.clip(half + 0.5 - np.abs(np.arange(HEIGHT) - (HEIGHT - 1) / 2), 0, 1)
    share = (down[:, None] * across)[..., None]
    square, wall = (np.power(np.array(bgr) / 255, GAMMA) for bgr in ((50, 50, 200), (190, 190, 185)))
    light = cv2.GaussianBlur(share * square + (1 - share) * wall, None, 0.7)  # as a lens mixes
    return np.round(255 * np.power(light, 1 / GAMMA)).astype(np.uint8)


@pytest.fixture
def sequence_folder(tmp_path: Path) -> Path:
    """Four frames, 2 cm apart, two of them JPEG."""
    folder = tmp_path / "run"
    (folder / "frames").mkdir(parents=True)
    rows = ["frame,file,t_s,x_cm,y_cm,z_cm,qw,qx,qy,qz"]
    for k in range(4):
        name = f"frames/{k:03d}.{'png' if k < 2 else 'jpg'}"
        full_chroma = [cv2.IMWRITE_JPEG_SAMPLING_FACTOR, cv2.IMWRITE_JPEG_SAMPLING_FACTOR_444]
        assert cv2.imwrite(str(folder / name), small_image(2.0 * k), [] if k < 2 else full_chroma)
        rows.append(f"{k},{name},{0.1 * k:.1f},0,0,{2.0 * k},1,0,0,0")
    (folder / "poses.csv").write_text("\n".join(rows) + "\n")
    camera = {"width": WIDTH, "height": HEIGHT, "fx": FOCAL, "fy": FOCAL, "cx": 47.5, "cy": 35.5}
    (folder / "camera.json").write_text(json.dumps(camera | {"distortion": [0, 0, 0, 0, 0]}))
    return folder
