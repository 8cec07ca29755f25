"""Read a survey area from a binary image: white is free, black an obstacle.

The image lies north up in the local frame: the pixel (0, 0), top left, is its north-west corner,
and the lower-left corner lies at the origin given. Free pixels are connected through edges, never
through corners. The outline of the free pixels is exact: its edges run along pixel edges, straight
in the local frame (they are subdivided every 100 m, so that the straight lon/lat lines between
their points stay within half a millimetre of them below 60° of latitude, images of a few
kilometres).
"""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import shapely

from mrmission.area.earth import area_text
from mrmission.area.formats import printable
from mrmission.area.frame import LocalFrame
from mrmission.area.parts import choose
from mrmission.area.rings import MAX_LATITUDE_DEG
from mrmission.errors import ConfigError, GeometryError, InputError
from mrmission.model import BoolArray, FloatArray, IntArray, OccupancyGrid, SurveyArea, read_only

FREE_THRESHOLD = 128
"""Pixels at least this bright, of 255, are free."""

MAX_PIXELS = 150_000_000
EDGE_M = 100.0
MAX_SIDE_M = 200_000.0


def read_image(
    path: Path,
    resolution_m: float,
    origin_lonlat: tuple[float, float],
    part: int | None = None,
) -> SurveyArea:
    """Read the free pixels of an image as a survey area.

    Parameters
    ----------
    path : Path
        PNG, PGM or another format that Pillow reads.
    resolution_m : float
        Side of a pixel, m.
    origin_lonlat : tuple of float
        Longitude and latitude of the image's lower-left corner, degrees.
    part : int, optional
        Keep only this connected part of the free pixels, 1 = largest.

    Returns
    -------
    SurveyArea
        The outline, and in ``image`` the free pixels as a grid of the area's local frame
        (:meth:`LocalFrame.of`), [column, row] with rows rising north.

    Raises
    ------
    ConfigError
        When the resolution or the origin is out of range.
    InputError
        When the file is no image that can be read.
    GeometryError
        When no pixel is free, or there is no such part.
    """
    _check_options(resolution_m, origin_lonlat)
    try:
        bright, notes = _brightness(path)
        return _area(path, bright, notes, resolution_m, origin_lonlat, part)
    except InputError as error:
        raise type(error)(f"{path}: {error}") from None


def _check_options(resolution_m: float, origin_lonlat: tuple[float, float]) -> None:
    if not (np.isfinite(resolution_m) and 0.001 <= resolution_m <= 10_000):
        raise ConfigError(f"--resolution {resolution_m}: must be metres per pixel, 0.001 to 10000")
    lon, lat = origin_lonlat
    if not (np.isfinite(lon) and np.isfinite(lat) and abs(lon) <= 360):
        raise ConfigError(f"--origin {lon},{lat}: must be LON,LAT in degrees")
    if abs(lat) > MAX_LATITUDE_DEG:
        raise ConfigError(
            f"--origin {lon},{lat}: latitude must be within ±{MAX_LATITUDE_DEG:g}; longitude first"
        )


def _brightness(path: Path) -> tuple[npt.NDArray[np.uint8], list[str]]:
    """Return the brightness of every pixel, (height, width), 0..255, and notes."""
    from PIL import Image, UnidentifiedImageError

    notes: list[str] = []
    try:
        with warnings.catch_warnings():
            # its own limit warns at 89 Mpixel; ours is checked below
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)
            with Image.open(path) as image:
                width, height = image.size
                if width * height > MAX_PIXELS:
                    raise InputError(
                        f"the image has {width} x {height} pixels, the limit is {MAX_PIXELS:,}; "
                        "scale it down"
                    )
                bright = _grey(image, notes)
    except FileNotFoundError:
        raise InputError("no such file; check the name") from None
    except UnidentifiedImageError:
        raise InputError("not an image that can be read; save it as PNG") from None
    except Image.DecompressionBombError:
        raise InputError(f"the image has more than {MAX_PIXELS:,} pixels; scale it down") from None
    except (OSError, SyntaxError, ValueError, EOFError) as error:
        if isinstance(error, InputError):
            raise
        reason = getattr(error, "strerror", None) or printable(str(error), 80)
        raise InputError(f"the image cannot be read: {reason}; save it as PNG again") from None
    histogram = np.bincount(bright.ravel(), minlength=256)
    grey = int(histogram[1:255].sum())
    if grey:
        share = grey / bright.size
        notes.append(
            f"{grey} pixels ({share:.2%}) are neither black nor white; those of brightness "
            f"{FREE_THRESHOLD} or more taken as free"
        )
    return bright, notes


def _grey(image: Any, notes: list[str]) -> npt.NDArray[np.uint8]:
    """Return brightness 0..255; what is transparent is no free space."""
    if image.mode in ("I;16", "I;16L", "I;16B", "I;16N", "I"):
        deep = np.asarray(image).astype(np.int64)
        top = 65_535 if deep.max(initial=0) > 255 else 255
        return (np.clip(deep, 0, top) * 255 // top).astype(np.uint8)
    if image.mode == "F":
        raise InputError("the image has floating-point pixels; save it as 8-bit PNG")
    if "A" in image.getbands() or "transparency" in image.info:
        rgba = image.convert("RGBA")
        bright = np.array(rgba.convert("L"))
        clear = np.asarray(rgba)[:, :, 3] < FREE_THRESHOLD
        if clear.any():
            notes.append(f"{int(clear.sum())} transparent pixels taken as obstacles")
            bright[clear] = 0
        return bright
    return np.array(image.convert("L"))


def _area(
    path: Path,
    bright: npt.NDArray[np.uint8],
    notes: list[str],
    resolution_m: float,
    origin_lonlat: tuple[float, float],
    part: int | None,
) -> SurveyArea:
    if max(bright.shape) * resolution_m > MAX_SIDE_M:
        raise GeometryError(
            f"the image is {max(bright.shape) * resolution_m / 1000:.0f} km wide at "
            f"{resolution_m:g} m per pixel, the limit is {MAX_SIDE_M / 1000:.0f} km; "
            "check --resolution"
        )
    # rows rise north, a column is contiguous
    free = np.ascontiguousarray((bright[::-1] >= FREE_THRESHOLD).T)
    if not free.any():
        raise GeometryError("no pixel is free (white); white is free, black an obstacle")
    pieces = pixel_polygons(free)
    order = sorted(range(len(pieces)), key=lambda i: (-pieces[i].area, pieces[i].bounds))
    pieces = [pieces[i] for i in order]
    notes = [*notes, f"free area {area_text(free.sum() * resolution_m**2)} in {free.sum()} pixels"]
    pieces, more = _choose(pieces, part, resolution_m)
    if part is not None:
        free = _pixels_in(free, pieces[0])
    water, corner = _placed(shapely.MultiPolygon(pieces), resolution_m, origin_lonlat)
    grid = OccupancyGrid(
        free=read_only(free),
        column_pitch_m=resolution_m,
        row_pitch_m=resolution_m,
        origin_m=(float(corner[0]), float(corner[1])),
    )
    return SurveyArea(
        name=printable(path.stem) or "image",
        source=str(path),
        water_lonlat=water,
        notes=(*notes, *more),
        image=grid,
    )


def _choose(
    pieces: list[shapely.Polygon], part: int | None, resolution_m: float
) -> tuple[list[shapely.Polygon], list[str]]:
    """Choose a part; the sizes in the note need metres, not pixels."""
    sizes = [piece.area * resolution_m**2 for piece in pieces]
    return choose(pieces, part, polygons=1, sizes_m2=sizes)


def pixel_polygons(free: BoolArray) -> list[shapely.Polygon]:
    """Return the outlines of the 4-connected parts of free cells, in cell units.

    Parameters
    ----------
    free : (columns, rows) bool array
        True where free; cell [i, j] is the unit square with its lower-left corner at (i, j).

    Returns
    -------
    list of Polygon
        Exact outlines with corners only; obstacles are holes.

    Notes
    -----
    The border of the free cells is cut into its longest straight stretches; stretches with the free
    cells on different sides end where they meet, so that cells that touch at a corner stay apart.
    The faces of that linework are the parts and the holes.
    """
    padded = np.pad(free, 1).astype(np.int8)
    # +1 where the free cell lies right of (above) the edge, -1 where it lies left of (below) it
    upright = _stretches(np.diff(padded, axis=0)[:, 1:-1])
    level = _stretches(np.diff(padded, axis=1)[1:-1, :].T)
    level = level[:, :, ::-1]
    lines = shapely.linestrings(np.concatenate([upright, level]).astype(np.float64))
    faces = shapely.get_parts(shapely.polygonize(lines))
    inside = shapely.get_coordinates(shapely.point_on_surface(faces))
    column, row = np.floor(inside).astype(np.int64).T
    return list(faces[free[column, row]])


def _stretches(edge: npt.NDArray[np.int8]) -> IntArray:
    """Return the longest runs of equal non-zero values along the second axis.

    Returns
    -------
    (n, 2, 2) int array
        [[line, from], [line, to]] of each run.
    """
    lines, length = edge.shape
    padded = np.zeros((lines, length + 2), dtype=np.int8)
    padded[:, 1:-1] = edge
    change = padded[:, 1:] != padded[:, :-1]
    begin = np.argwhere(change & (padded[:, 1:] != 0))
    end = np.argwhere(change & (padded[:, :-1] != 0))
    return np.stack([begin, end], axis=1)


def _pixels_in(free: BoolArray, piece: shapely.Polygon) -> BoolArray:
    """Return the free cells that belong to one part: whole runs of a column at once."""
    step = np.diff(np.pad(free, ((0, 0), (1, 1))).astype(np.int8), axis=1)
    column, start = np.nonzero(step == 1)
    _, stop = np.nonzero(step == -1)
    shapely.prepare(piece)
    kept = shapely.contains_xy(piece, column + 0.5, start + 0.5)
    marks = np.zeros((free.shape[0], free.shape[1] + 1), dtype=np.int8)
    marks[column[kept], start[kept]] = 1
    marks[column[kept], stop[kept]] -= 1
    inside: BoolArray = np.cumsum(marks, axis=1, dtype=np.int8)[:, :-1] == 1
    return inside


def _placed(
    outline: shapely.MultiPolygon, resolution_m: float, origin_lonlat: tuple[float, float]
) -> tuple[shapely.MultiPolygon, FloatArray]:
    """Return the outline in lon/lat, and the image's lower-left corner in the area's frame.

    The frame is centred on the centroid of the area, which is only known once the area is placed;
    the second step already changes the centre by less than the rounding of a double, so four are
    plenty.
    """
    metric = shapely.transform(outline, lambda c: c * resolution_m)
    metric = shapely.segmentize(metric, EDGE_M)
    origin = np.array(origin_lonlat, dtype=np.float64)
    guess = LocalFrame(lon_deg=float(origin[0]), lat_deg=float(origin[1]))
    lon, lat = guess.to_lonlat(shapely.get_coordinates(metric.centroid)[0])
    frame = LocalFrame(lon_deg=float(lon), lat_deg=float(lat))
    for _ in range(4):
        corner = frame.to_metric(origin)
        water = shapely.transform(metric, _placer(frame, corner))
        water = shapely.MultiPolygon(shapely.get_parts(water))  # GEOS unwraps a single part
        centred = LocalFrame.of_lonlat(water)
        if centred == frame:
            break
        frame = centred
    return water, frame.to_metric(origin)


def _placer(frame: LocalFrame, corner: FloatArray) -> Any:
    return lambda points: frame.to_lonlat(points + corner)
