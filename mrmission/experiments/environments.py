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
        (90, 70, 260, 150), (150, 330, 240, 450), (330, 120, 420, 250), (370, 400, 520, 470),
        (600, 90, 690, 180), (560, 540, 700, 680), (0, 540, 300, 600), (760, 250, 860, 340),
    ]  # fmt: skip
    for box in boxes:
        draw.rounded_rectangle(box, radius=20, fill=0)
    draw.polygon([(690, 470), (760, 400), (840, 460), (800, 560), (720, 540)], fill=0)


def _ellipses(draw: Any) -> None:
    boxes = [
        (60, 60, 420, 110), (500, 40, 900, 90), (90, 180, 150, 480), (220, 190, 280, 420),
        (360, 170, 700, 215), (360, 280, 560, 330), (620, 290, 850, 335), (350, 400, 400, 560),
        (470, 410, 660, 470), (740, 410, 790, 620), (850, 400, 900, 600), (120, 560, 300, 610),
    ]  # fmt: skip
    for box in boxes:
        draw.ellipse(box, fill=0)


def _rooms(draw: Any) -> None:
    walls = [
        (40, 40, 440, 50), (40, 40, 50, 180), (40, 250, 50, 440), (40, 430, 200, 440),
        (270, 430, 440, 440), (430, 40, 440, 440), (50, 150, 130, 160), (190, 150, 300, 160),
        (290, 50, 300, 100), (290, 160, 300, 220), (290, 290, 300, 430), (300, 250, 370, 260),
        (120, 250, 220, 300), (100, 350, 150, 390), (350, 90, 390, 130),
    ]  # fmt: skip
    for wall in walls:
        draw.rectangle(wall, fill=0)
    draw.ellipse((330, 310, 400, 380), fill=0)


def _shore(draw: Any) -> None:
    polygons = [
        [(0, 0), (330, 0), (300, 50), (210, 70), (180, 120), (90, 130), (60, 210), (0, 240)],
        [(960, 160), (900, 190), (880, 260), (800, 280), (830, 330), (900, 340), (960, 400)],
        [(0, 500), (70, 480), (120, 540), (220, 560), (260, 620), (380, 640), (420, 680), (0, 680)],
        [(560, 680), (600, 600), (680, 610), (700, 540), (760, 560), (820, 640), (850, 680)],
        [(380, 200), (450, 170), (520, 210), (490, 260), (420, 280)],
        [(230, 330), (300, 300), (330, 360), (290, 420), (240, 400)],
        [(520, 380), (570, 350), (640, 380), (620, 440), (570, 420), (540, 450)],
        [(620, 90), (700, 60), (760, 110), (680, 140)],
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
