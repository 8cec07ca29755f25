"""``mrmission warm``: compile the inner loops once, so that the first plan is as fast as any."""

from __future__ import annotations

import click


@click.command()
def warm() -> int:
    """Compile and cache the inner loops once (the first plan does it otherwise)."""
    import numpy as np
    import shapely

    from mrmission.model import SurveyArea
    from mrmission.options import PlanOptions
    from mrmission.pipeline import plan

    half = 0.002
    shore = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * half
    island = np.array([[-0.3, -0.2], [0.25, -0.3], [0.2, 0.3]]) * half
    lake = shapely.MultiPolygon([shapely.Polygon(shore, [island])])
    area = SurveyArea(name="warm", source="warm", water_lonlat=lake)
    for method in ("minmax", "auto"):
        plan(area, PlanOptions(robots=2, swath_m=40.0, clearance_m=5.0, method=method))
    click.echo("ready", err=True)
    return 0
