"""Images: exact outlines, 4-connectivity, and the grid in the area's own frame."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import shapely
from PIL import Image

from mrmission.area.frame import LocalFrame, project_polygons
from mrmission.area.geojson import free_area_geojson, read_survey_area
from mrmission.area.image import pixel_polygons, read_image
from mrmission.errors import ConfigError, GeometryError, InputError

ORIGIN = (-81.3, 34.06)


def cells(text: str) -> np.ndarray:
    """[column, row] with rows rising, from lines drawn top down, # an obstacle."""
    lines = text.split()
    return np.array([[c != "#" for c in line] for line in lines])[::-1].T


def save(path: Path, text: str) -> Path:
    free = cells(text)
    Image.fromarray((free.T[::-1] * 255).astype(np.uint8)).save(path)
    return path


def boxes(free: np.ndarray) -> shapely.Geometry:
    """Union of the free pixels one by one."""
    return shapely.union_all([shapely.box(i, j, i + 1, j + 1) for i, j in np.argwhere(free)])


def test_diagonal_pixels_are_not_connected() -> None:
    parts = pixel_polygons(cells(".# #."))
    assert sorted(part.bounds for part in parts) == [(0, 1, 1, 2), (1, 0, 2, 1)]


def test_diagonal_obstacles_do_not_enclose_a_pixel() -> None:
    # the free middle is closed in by four obstacles that touch at corners only
    (middle, ring) = sorted(
        pixel_polygons(cells("..... ..#.. .#.#. ..#.. .....")), key=lambda p: p.area
    )
    assert middle.bounds == (2, 2, 3, 3)
    assert ring.area == 20
    assert ring.is_valid


def test_islands_are_holes_with_corners_only() -> None:
    (part,) = pixel_polygons(cells("...... .##... .##.#. ......"))
    assert len(part.interiors) == 2
    assert len(part.exterior.coords) == 5
    assert part.area == 24 - 5


@pytest.mark.parametrize("seed", range(20))
def test_random_images_against_pixel_by_pixel_union(seed: int) -> None:
    rng = np.random.default_rng(seed)
    free = rng.random((9, 7)) < rng.uniform(0.2, 0.9)
    parts = pixel_polygons(free)
    assert all(part.is_valid for part in parts)
    assert sum(part.area for part in parts) == free.sum()
    assert shapely.union_all(parts).equals(boxes(free)) or not free.any()
    # flood fill as the oracle of 4-connectivity
    label = np.zeros(free.shape, dtype=int)
    count = 0
    for cell in map(tuple, np.argwhere(free)):
        if label[cell]:
            continue
        count += 1
        stack = [cell]
        while stack:
            i, j = stack.pop()
            if 0 <= i < 9 and 0 <= j < 7 and free[i, j] and not label[i, j]:
                label[i, j] = count
                stack += [(i + 1, j), (i - 1, j), (i, j + 1), (i, j - 1)]
    assert len(parts) == count


def test_pixel_zero_is_north_west(tmp_path: Path) -> None:
    path = save(tmp_path / "map.png", ".## ### ###")
    area = read_image(path, 10.0, ORIGIN)
    assert area.image is not None
    assert np.argwhere(area.image.free).tolist() == [[0, 2]]
    west, south, east, north = area.water_lonlat.bounds
    assert west == pytest.approx(-81.3, abs=1e-8)
    assert south == pytest.approx(34.06 + 20 / 110_930, abs=1e-7)
    assert east - west == pytest.approx(10 / 92_300, rel=1e-3)
    assert north > south


@pytest.mark.parametrize("lat", [0.0, 34.06, -60.0])
def test_grid_and_outline_agree_in_the_frame_of_the_area(tmp_path: Path, lat: float) -> None:
    rng = np.random.default_rng(3)
    free = rng.random((40, 30)) < 0.7
    free[0, :] = free[:, 0] = True
    path = tmp_path / "map.png"
    Image.fromarray((free.T[::-1] * 255).astype(np.uint8)).save(path)
    area = read_image(path, 50.0, (179.99, lat))
    grid = area.image
    assert grid is not None
    assert (grid.free == free).all()
    assert not grid.free.flags.writeable
    frame = LocalFrame.of(area)
    water = project_polygons(area.water_lonlat, frame)
    corner = frame.to_metric(np.array([179.99, lat]))
    assert grid.origin_m == pytest.approx(tuple(corner), abs=1e-6)
    expected = shapely.transform(boxes(free), lambda c: c * 50.0 + corner)
    # 2 km at 60 degrees of latitude; edges stay within half a millimetre
    assert shapely.hausdorff_distance(water.boundary, expected.boundary) < 5e-4
    assert water.area == pytest.approx(free.sum() * 2500, rel=1e-6)


def test_part_restricts_outline_and_grid(tmp_path: Path) -> None:
    path = save(tmp_path / "map.png", "...#. .#.#. ...#.")
    area = read_image(path, 1.0, ORIGIN)
    assert len(area.water_lonlat.geoms) == 2
    assert "water is in 2 parts" in area.notes[-1]
    assert "1: 8 m², 2: 3 m²" in area.notes[-1]
    for part, count in ((1, 8), (2, 3)):
        chosen = read_image(path, 1.0, ORIGIN, part=part)
        assert chosen.image is not None
        assert chosen.image.free.sum() == count
        assert len(chosen.water_lonlat.geoms) == 1
    with pytest.raises(GeometryError, match="--part 3: the water has 2 parts"):
        read_image(path, 1.0, ORIGIN, part=3)


def test_modes_threshold_and_transparency(tmp_path: Path) -> None:
    levels = np.array([[0, 127, 128, 255]], dtype=np.uint8)
    images = {
        "grey.png": Image.fromarray(levels),
        "rgb.png": Image.fromarray(np.repeat(levels[:, :, None], 3, axis=2)),
        "grey.pgm": Image.fromarray(levels),
        "deep.png": Image.fromarray(levels.astype(np.uint16) * 257),
    }
    for name, image in images.items():
        image.save(tmp_path / name)
        area = read_image(tmp_path / name, 1.0, ORIGIN)
        assert area.image is not None
        assert area.image.free.ravel().tolist() == [False, False, True, True], name
        assert area.notes[0].startswith("2 pixels (50.00%) are neither black nor white")
    rgba = np.full((1, 2, 4), 255, dtype=np.uint8)
    rgba[0, 1, 3] = 0
    Image.fromarray(rgba).save(tmp_path / "rgba.png")
    area = read_image(tmp_path / "rgba.png", 1.0, ORIGIN)
    assert area.image is not None
    assert area.image.free.ravel().tolist() == [True, False]
    assert area.notes[0] == "1 transparent pixels taken as obstacles"
    Image.fromarray(levels > 128).save(tmp_path / "one.png")
    assert read_image(tmp_path / "one.png", 1.0, ORIGIN).water_lonlat.area > 0


def test_refused(tmp_path: Path) -> None:
    path = save(tmp_path / "black.png", "## ##")
    with pytest.raises(GeometryError, match=r"black.png: no pixel is free"):
        read_image(path, 1.0, ORIGIN)
    with pytest.raises(InputError, match="no such file"):
        read_image(tmp_path / "none.png", 1.0, ORIGIN)
    (tmp_path / "text.png").write_text("no image")
    with pytest.raises(InputError, match="not an image"):
        read_image(tmp_path / "text.png", 1.0, ORIGIN)
    white = save(tmp_path / "white.png", ".." + " .#" * 200)
    (tmp_path / "cut.png").write_bytes(white.read_bytes()[:45])
    with pytest.raises(InputError, match=r"cut\.png: "):
        read_image(tmp_path / "cut.png", 1.0, ORIGIN)
    with pytest.raises(GeometryError, match="check --resolution"):
        read_image(white, 5000.0, ORIGIN)
    for resolution in (0.0, -1.0, float("nan"), float("inf")):
        with pytest.raises(ConfigError, match="--resolution"):
            read_image(white, resolution, ORIGIN)
    for origin in ((34.06, -91.3), (float("nan"), 0.0), (500.0, 0.0)):
        with pytest.raises(ConfigError, match="--origin"):
            read_image(white, 1.0, origin)


def test_robot_maps_keep_their_area_and_read_back(shared_data: Path, tmp_path: Path) -> None:
    paths = sorted((shared_data / "maps").rglob("*.png"))
    assert len(paths) >= 16
    for path in paths:
        area = read_image(path, 1.0, ORIGIN, part=1)
        assert area.image is not None
        count = int(area.image.free.sum())
        water = project_polygons(area.water_lonlat, LocalFrame.of(area))
        assert water.area == pytest.approx(count, rel=1e-6), path
        out = tmp_path / "area.geojson"
        out.write_text(free_area_geojson(area), encoding="utf-8")
        again = read_survey_area(out)
        assert again.notes == (), path
        assert again.water_lonlat.area == pytest.approx(area.water_lonlat.area, rel=1e-6)


def test_paper_map_has_the_published_number_of_free_pixels(shared_data: Path) -> None:
    area = read_image(shared_data / "maps" / "paper" / "cave.png", 1.0, ORIGIN)
    assert area.image is not None
    assert area.image.free.sum() == 586_050
