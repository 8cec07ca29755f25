"""Reading AREA, whatever it is."""

from __future__ import annotations

from pathlib import Path

from mrmission.errors import ConfigError
from mrmission.model import SurveyArea

IMAGE_SUFFIXES = (".png", ".pgm", ".pbm", ".bmp", ".tif", ".tiff", ".gif", ".jpg", ".jpeg")


def read_area(
    path: Path,
    resolution_m: float | None,
    origin_lonlat: tuple[float, float] | None,
    part: int | None,
    islands: bool = False,
) -> SurveyArea:
    """Return the survey area in a GeoJSON file or a binary image.

    Raises
    ------
    ConfigError
        When an image comes without its resolution and origin, or these with something else.
    InputError
        When the file cannot be used.
    """
    if path.suffix.lower() in IMAGE_SUFFIXES:
        from mrmission.area.image import read_image

        if resolution_m is None or origin_lonlat is None:
            raise ConfigError(
                f"{path}: an image needs --resolution (metres per pixel) and --origin LON,LAT "
                "(its lower left corner)"
            )
        return read_image(path, resolution_m=resolution_m, origin_lonlat=origin_lonlat, part=part)
    if resolution_m is not None or origin_lonlat is not None:
        raise ConfigError(f"{path}: --resolution and --origin go with an image only")
    from mrmission.area.geojson import read_survey_area

    return read_survey_area(path, part=part, islands=islands)
