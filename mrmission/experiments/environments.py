"""The four environments of the paper from a folder, or four of our own making."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from mrmission.errors import InputError
from mrmission.experiments.random_maps import largest_part
from mrmission.model import BoolArray

PUBLISHED = "published_results.json"
OWN = ("boulders", "ellipses", "rooms", "shore")


@dataclass(frozen=True, slots=True, kw_only=True)
class PublishedRow:
    """What the authors published for one planner: per k the maximum cost and the tours used."""

    robots: tuple[int, ...]
    max_cost: tuple[float, ...]
    tours: tuple[int, ...]
    cells: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Environment:
    """A map by name; ``source`` is its file, or ``own:NAME`` for one drawn here."""

    name: str
    source: str
    published: Mapping[str, PublishedRow]


def environments(folder: Path | None) -> list[Environment]:
    """Return the environments of a folder of images, or our own.

    Parameters
    ----------
    folder
        Holds PNG files, white free and black an obstacle, and may hold
        ``published_results.json`` with the authors' figures.

    Raises
    ------
    InputError
        When the folder holds no image, or its figures cannot be read.
    """
    if folder is None:
        return [Environment(name=name, source=f"own:{name}", published={}) for name in OWN]
    images = sorted(folder.glob("*.png"))
    if not images:
        raise InputError(f"--maps {folder}: holds no PNG; name the folder of the maps")
    figures = _read_published(folder / PUBLISHED)
    return [
        Environment(name=path.stem, source=str(path), published=figures.get(path.name, {}))
        for path in images
    ]


def _read_published(path: Path) -> dict[str, dict[str, PublishedRow]]:
    if not path.exists():
        return {}
    try:
        results: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))["results"]
        return {
            image: {
                planner: PublishedRow(
                    robots=tuple(row["k"]),
                    max_cost=tuple(row["max_cost"]),
                    tours=tuple(row["tours"]),
                    cells=row["cells"],
                )
                for planner, row in rows.items()
            }
            for image, rows in results.items()
        }
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError(
            f"{path}: not the figures of the study ({type(error).__name__}: {error}); "
            "leave the file out to go without them"
        ) from None


def free_pixels(source: str) -> BoolArray:
    """Return (columns, rows) True where an environment is free: its largest connected part."""
    if source.startswith("own:"):
        return largest_part(draw_environment(source.removeprefix("own:")))
    from mrmission.area.image import read_image

    image = read_image(Path(source), 1.0, (0.0, 0.0), part=1).image
    if image is None:
        raise InputError(f"{source}: holds no pixels; give an image")
    return image.free


def draw_environment(name: str) -> BoolArray:
    """Draw one of our own environments, (columns, rows), rows rising.

    ``boulders`` has rounded blocks and a spur from the border, ``ellipses`` long and round
    islands, ``rooms`` walls with doors, ``shore`` a ragged shore with islands.
    """
    from PIL import Image, ImageDraw

    draw_on = {"boulders": _boulders, "ellipses": _ellipses, "rooms": _rooms, "shore": _shore}[name]
    size = (480, 480) if name == "rooms" else (960, 680)
    image = Image.new("L", size, 255)
    draw_on(ImageDraw.Draw(image))
    return np.ascontiguousarray((np.asarray(image)[::-1] >= 128).T)


def _boulders(draw: Any) -> None:
    boxes = [
        (120, 90, 230, 190), (90, 380, 180, 500), (300, 450, 450, 540), (330, 200, 410, 300),
        (780, 380, 880, 500), (650, 540, 790, 680), (560, 180, 960, 270),
    ]  # fmt: skip
    for box in boxes:
        draw.rounded_rectangle(box, radius=24, fill=0)
    draw.polygon([(700, 190), (750, 90), (830, 130), (790, 260)], fill=0)


def _ellipses(draw: Any) -> None:
    boxes = [
        (130, 80, 760, 125), (220, 180, 600, 220), (180, 270, 720, 325), (250, 390, 680, 440),
        (60, 520, 290, 565), (330, 480, 370, 600), (440, 485, 480, 620), (550, 480, 610, 590),
        (780, 170, 850, 560), (890, 230, 930, 500), (270, 635, 820, 660),
    ]  # fmt: skip
    for box in boxes:
        draw.ellipse(box, fill=0)


def _rooms(draw: Any) -> None:
    walls = [
        (60, 60, 130, 70), (190, 60, 420, 70), (60, 60, 70, 420), (410, 60, 420, 420),
        (60, 410, 110, 420), (170, 410, 280, 420), (350, 410, 420, 420), (70, 200, 240, 210),
        (232, 60, 242, 100), (232, 150, 242, 410), (110, 120, 180, 155), (300, 300, 360, 345),
    ]  # fmt: skip
    for wall in walls:
        draw.rectangle(wall, fill=0)
    draw.ellipse((310, 110, 350, 240), fill=0)


def _shore(draw: Any) -> None:
    polygons = [
        [(0, 0), (50, 0), (40, 60), (95, 130), (140, 120), (130, 170), (75, 190), (30, 300),
         (25, 400), (140, 470), (150, 510), (215, 500), (320, 590), (400, 680), (0, 680)],
        [(420, 680), (470, 590), (530, 520), (560, 535), (640, 470), (670, 520), (740, 560),
         (640, 610), (560, 620), (500, 680)],
        [(680, 0), (700, 40), (760, 90), (720, 150), (790, 170), (830, 110), (730, 0)],
        [(330, 350), (370, 345), (420, 335), (410, 400), (380, 370), (335, 395)],
        [(310, 440), (350, 435), (380, 500), (345, 545)],
        [(700, 300), (770, 280), (785, 380), (730, 375)],
        [(840, 360), (900, 345), (960, 375), (960, 400), (880, 380)],
    ]  # fmt: skip
    for corners in polygons:
        draw.polygon(corners, fill=0)


def impossible(
    row: PublishedRow, free_px: float, planner: str = "", relative: float = 1e-6
) -> list[str]:
    """Return what of an author's row cannot be, in words.

    Every free pixel is swept by somebody and travel only adds to it, so k tours cost at least the
    free area in all, and the longest at least a k-th of that.
    """
    out = []
    for robots, cost in zip(row.robots, row.max_cost, strict=True):
        least = free_px / robots
        if cost < least * (1 - relative):
            what = (
                f"one tour of {cost:,.0f} is below the free area"
                if robots == 1
                else f"a maximum of {cost:,.0f} at k = {robots} is below the free area over k"
            )
            out.append(f"{planner} {what}, {least:,.0f}, by {1 - cost / least:.1%}".strip())
    return out
