r"""Subdivide legs so that every reading of a straight line agrees to a tolerance.

A leg that is straight in the local frame, the line straight in lon/lat between its ends (RFC 7946),
and the geodesic (great circle) between them are three curves. A straight lon/lat line at latitude
:math:`\varphi` and bearing :math:`\theta` departs from the geodesic with the curvature
:math:`\tan\varphi \sin\theta (1 + \cos^2\theta) / R \le 1.089 \tan\varphi / R`; a straight
line of the frame at a distance :math:`c` from its centre with at most
:math:`2c / 3R^2`. Two curves with common ends whose curvatures differ by :math:`\kappa` depart by
at most :math:`\kappa L^2 / 8` over a length :math:`L`: no piece is longer than
:math:`\sqrt{8 t / \kappa}`.
"""

from __future__ import annotations

import math

import numpy as np

from mrmission.area.frame import LocalFrame
from mrmission.errors import GeometryError
from mrmission.model import FloatArray, IntArray

CURVATURE_RADIUS_M = 6_335_439.0
"""The smallest radius of curvature of WGS 84 (of the meridian at the equator)."""

WORST_BEARING = 4 / 3 * math.sqrt(2 / 3)
"""Maximum of sin θ (1 + cos² θ)."""

SAFETY = 1.05
"""On the length of a piece: the latitude, and with it the curvature, changes along the leg."""


def leg_tolerance_m(swath_m: float) -> float:
    """Return how far a leg may depart between any two readings of a straight line, m."""
    return min(0.1, max(0.01, 0.002 * swath_m))


def subdivide_legs(
    points_m: FloatArray, frame: LocalFrame, tolerance_m: float = 0.1
) -> tuple[FloatArray, IntArray]:
    """Insert points on legs until all readings of "straight" agree to the tolerance.

    Parameters
    ----------
    points_m : (n, 2) float array
        Waypoints, local frame; leg i runs from point i to i + 1, straight in the frame.
    frame : LocalFrame
        The frame.
    tolerance_m : float
        Largest distance between the straight lon/lat line, the geodesic and the straight line of
        the frame between two consecutive points, m.

    Returns
    -------
    points_m : (m, 2) float array
        The points with those inserted; the given ones keep their bits.
    source_leg : (m − 1,) int array
        The leg of the input that each leg of the output is a piece of.

    Raises
    ------
    GeometryError
        When a leg reaches beyond 89° of latitude.
    """
    points = np.asarray(points_m, dtype=np.float64).reshape(-1, 2)
    if len(points) < 2:
        return points.copy(), np.zeros(0, dtype=np.int64)
    lengths = np.hypot(*np.diff(points, axis=0).T)
    pieces = np.maximum(
        np.ceil(lengths / _longest_piece_m(points, lengths, frame, tolerance_m)), 1
    ).astype(np.int64)
    source = np.repeat(np.arange(len(pieces), dtype=np.int64), pieces)
    first = np.concatenate([[0], np.cumsum(pieces)[:-1]])
    step = np.arange(len(source)) - first[source]
    share = (step / pieces[source])[:, None]
    start, stop = points[:-1][source], points[1:][source]
    inner = np.where(step[:, None] == 0, start, start + share * (stop - start))
    return np.vstack([inner, points[-1:]]), source


def _longest_piece_m(
    points: FloatArray, lengths: FloatArray, frame: LocalFrame, tolerance_m: float
) -> FloatArray:
    """Return the longest piece that each leg may be cut into, m."""
    lat = np.abs(frame.to_lonlat(points)[:, 1])
    ends = np.radians(np.maximum(lat[:-1], lat[1:]))
    # between its ends a leg comes nearer to the pole by less than its sagitta; twice that is safe
    bulge = lengths**2 * np.tan(np.minimum(ends, math.radians(89))) / (4 * CURVATURE_RADIUS_M**2)
    highest = ends + bulge
    if (highest > math.radians(89)).any():
        raise GeometryError(
            f"a leg reaches {math.degrees(float(highest.max())):.1f} degrees of latitude, the "
            "limit is 89; choose an area farther from the pole"
        )
    reach = np.hypot(points[:, 0], points[:, 1])
    centre_distance = np.maximum(reach[:-1], reach[1:])
    curvature = (
        WORST_BEARING * np.tan(highest) / CURVATURE_RADIUS_M
        + 2 / 3 * centre_distance / CURVATURE_RADIUS_M**2
    )
    with np.errstate(divide="ignore"):
        longest: FloatArray = np.sqrt(8 * tolerance_m / curvature) / SAFETY
    # near the equator the curvature vanishes at one place and not beside it
    return np.minimum(longest, _equator_piece_m(tolerance_m))


def _equator_piece_m(tolerance_m: float) -> float:
    """Return the longest piece anywhere, where the latitude at its ends may be zero.

    A piece of length L that starts at the equator reaches tan φ = L/R: L³ / 8R² ≤ t.
    """
    return float((4 * tolerance_m * CURVATURE_RADIUS_M**2) ** (1 / 3))
