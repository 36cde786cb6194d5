"""Outlines of regions in photographs beside the outlines that people drew.

    python -m bench.stills FOLDER [--merge-distances 7.5 10 ...] [--json FILE]

FOLDER holds images/NAME.jpg (or .png) and gt/NAME.npz with `seg`: (annotators, H, W) label images. Every
photograph is cut up at each merge distance, and by felzenszwalb at the scale that gives it as many regions.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from zipfile import BadZipFile

import cv2
import numpy as np
from rich.console import Console
from rich.table import Table
from tyro.conf import Positional

from bench.figures_file import check_json, write_json
from bench.flat_scenes import labels_of
from bench.options import at_least
from host.config import read_options
from host.errors import InputError, UsageError, run_command
from host.rbdn import Net, NetConfig

TOLERANCE = 0.0075  # of the image diagonal; outlines nearer than this agree
SCALES = np.geomspace(20_000, 10, 64)  # of felzenszwalb, from few regions to many
IMAGE_SUFFIXES = (".jpg", ".jpeg", ".png")
OURS, RIVAL = "net", "felzenszwalb"


@dataclass(frozen=True)
class Options:
    """Compare the net's outlines in photographs with people's, beside felzenszwalb's."""

    folder: Positional[Path]
    """Holds images/NAME.jpg and gt/NAME.npz."""
    merge_distances: tuple[float, ...] = (7.5, 10.0, 14.0)
    """Settings of the net; each gives another number of regions."""
    json: Path | None = None
    """Also write the figures to this file."""


@dataclass(frozen=True)
class Agreement:
    """Outline pixels counted over images: found and true ones, and those of each that have the other near."""

    images: int = 0
    regions: int = 0
    found: int = 0
    found_right: int = 0
    true: int = 0
    true_found: int = 0
    cpu_ms: float = 0.0

    def __add__(self, other: Agreement) -> Agreement:
        mine, theirs = asdict(self), asdict(other)
        return Agreement(**{name: mine[name] + theirs[name] for name in mine})

    @property
    def precision(self) -> float:
        """Share of the found outlines that somebody drew."""
        return self.found_right / max(self.found, 1)

    @property
    def recall(self) -> float:
        """Share of the drawn outlines that were found."""
        return self.true_found / max(self.true, 1)

    @property
    def f(self) -> float:
        """Harmonic mean of precision and recall."""
        total = self.precision + self.recall
        return 2 * self.precision * self.recall / total if total > 0 else 0.0

    def figures(self) -> dict[str, float]:
        """What the table shows, for JSON."""
        return {
            "regions_per_image": self.regions / self.images,
            "precision": self.precision,
            "recall": self.recall,
            "f": self.f,
            "cpu_ms_per_image": self.cpu_ms / self.images,
        }


def agreement(labels: np.ndarray, drawn: np.ndarray, cpu_ms: float = 0.0) -> Agreement:
    """Compares the outlines of one segmentation with those of several people.

    Parameters
    ----------
    labels
        (H, W) regions found.
    drawn
        (N, H, W) regions, one label image a person. A found outline is right where anybody drew one; the
        drawn ones of all people count.
    """
    tolerance_px = TOLERANCE * np.hypot(*labels.shape)
    found = _outlines(labels)
    near_found = _distance_px(found) <= tolerance_px
    people = [_outlines(person) for person in drawn]
    near_people = np.any([_distance_px(person) <= tolerance_px for person in people], axis=0)
    return Agreement(
        images=1,
        regions=len(np.unique(labels)),
        found=int(found.sum()),
        found_right=int((found & near_people).sum()),
        true=sum(int(person.sum()) for person in people),
        true_found=sum(int((person & near_found).sum()) for person in people),
        cpu_ms=cpu_ms,
    )


def _outlines(labels: np.ndarray) -> np.ndarray:
    """Pixels whose right or lower neighbour has another label."""
    out = np.zeros(labels.shape, bool)
    out[:, :-1] |= labels[:, :-1] != labels[:, 1:]
    out[:-1] |= labels[:-1] != labels[1:]
    return out


def _distance_px(outlines: np.ndarray) -> np.ndarray:
    if not outlines.any():
        return np.full(outlines.shape, np.inf)
    return cv2.distanceTransform((~outlines).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)


class Felzenszwalb:
    """felzenszwalb with as many regions of one image as asked for, as nearly as its scale allows."""

    def __init__(self, image: np.ndarray) -> None:
        self._rgb = np.ascontiguousarray(image[:, :, ::-1])
        self._made: dict[int, tuple[np.ndarray, float]] = {}

    def __call__(self, regions: int) -> tuple[np.ndarray, float]:
        """Labels and CPU milliseconds of one run."""
        low, high = 0, len(SCALES) - 1
        while low < high:
            middle = (low + high) // 2
            if self._count(middle) < regions:
                low = middle + 1
            else:
                high = middle
        return self._run(min((max(low - 1, 0), low), key=lambda k: abs(self._count(k) - regions)))

    def _count(self, k: int) -> int:
        return len(np.unique(self._run(k)[0]))

    def _run(self, k: int) -> tuple[np.ndarray, float]:
        from skimage.segmentation import felzenszwalb  # pyright: ignore[reportMissingImports]

        if k not in self._made:
            self._made[k] = _timed(lambda: felzenszwalb(self._rgb, scale=SCALES[k], sigma=0.8, min_size=100))
        return self._made[k]


def _timed(run: Callable[[], np.ndarray]) -> tuple[np.ndarray, float]:
    begin = time.thread_time()
    out = run()
    return out, 1e3 * (time.thread_time() - begin)


def measure(
    options: Options, photographs: list[tuple[Path, np.ndarray]]
) -> dict[float, dict[str, Agreement]]:
    """Pooled agreement by merge distance and method."""
    results = {distance: {OURS: Agreement(), RIVAL: Agreement()} for distance in options.merge_distances}
    for path, drawn in photographs:
        image = cv2.imread(str(path))
        if image is None:
            raise InputError(f"{path}: no image that OpenCV can read; replace it or take it out")
        if drawn.shape[1:] != image.shape[:2]:
            raise InputError(f"{path}: {image.shape[:2]} px, but its labels have {drawn.shape[1:]}")
        height, width = image.shape[:2]
        rival = Felzenszwalb(image)
        for distance, rows in results.items():
            net = Net(NetConfig(merge_distance=distance))
            begin = time.thread_time()
            snapshot = net.track(image)
            cpu_ms = 1e3 * (time.thread_time() - begin)
            mine = agreement(labels_of(snapshot, width, height), drawn, cpu_ms)
            rows[OURS] += mine
            labels, cpu_ms = rival(mine.regions)
            rows[RIVAL] += agreement(labels, drawn, cpu_ms)
    return results


def _photographs(folder: Path) -> list[tuple[Path, np.ndarray]]:
    images = sorted(p for p in (folder / "images").glob("*") if p.suffix.lower() in IMAGE_SUFFIXES)
    if not images:
        raise InputError(f"{folder}: no images/*.jpg in it; give a folder of labelled photographs")
    out = []
    for path in images:
        labels = folder / "gt" / f"{path.stem}.npz"
        try:
            with np.load(labels) as archive:
                out.append((path, archive["seg"].astype(np.int32)))
        except (OSError, KeyError, ValueError, BadZipFile) as error:
            raise InputError(
                f"{labels}: cannot read `seg` from it ({error}); one is needed a photo"
            ) from error
    return out


def main() -> None:
    """Measure, print the table, and write it as JSON if asked to."""
    options = read_options(Options)
    check_json(options.json)
    at_least("merge-distances", len(options.merge_distances), 1)
    at_least("merge-distances", min(options.merge_distances), 1)
    photographs = _photographs(options.folder)
    try:
        import skimage  # noqa: F401  # pyright: ignore[reportMissingImports]
    except ImportError as error:
        raise UsageError("felzenszwalb is missing: .venv/bin/pip install -e '.[bench]'") from error
    cv2.setNumThreads(1)
    results = measure(options, photographs)
    table = Table(title=f"Outlines in {len(photographs)} photographs against people's")
    for heading in ("merge distance", "method"):
        table.add_column(heading)
    for heading in ("regions", "precision", "recall", "F", "CPU ms"):
        table.add_column(heading, justify="right")
    for distance, rows in results.items():
        for name, row in rows.items():
            figures = row.figures()
            shown = (f"{figures[key]:.3f}" for key in ("precision", "recall", "f"))
            regions, cpu_ms = f"{figures['regions_per_image']:.1f}", f"{figures['cpu_ms_per_image']:.1f}"
            table.add_row(f"{distance:g}", name, regions, *shown, cpu_ms)
        table.add_section()
    Console(width=110).print(table)
    document = {
        f"{distance:g}": {name: row.figures() for name, row in rows.items()}
        for distance, rows in results.items()
    }
    write_json(options.json, document)


if __name__ == "__main__":
    run_command(main)
