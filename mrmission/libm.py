"""Angles and their functions with the same last digits on every processor.

numpy has several versions of these and takes the one that suits the processor; their last digits
differ. A search that weighs one cost against another goes another way for a last digit, so what it
hangs on is computed with these, which are those of the C library. Products of matrices, for which
numpy's library has as many versions, are sums of plain products here: :func:`times`.
"""

from __future__ import annotations

import math

import numpy as np
from numba import vectorize

from mrmission.model import FloatArray


@vectorize(cache=True)
def sin(x):  # type: ignore[no-untyped-def]
    """Return the sine of angles, rad."""
    return math.sin(x)


@vectorize(cache=True)
def cos(x):  # type: ignore[no-untyped-def]
    """Return the cosine of angles, rad."""
    return math.cos(x)


@vectorize(cache=True)
def tan(x):  # type: ignore[no-untyped-def]
    """Return the tangent of angles, rad."""
    return math.tan(x)


@vectorize(cache=True)
def arccos(x):  # type: ignore[no-untyped-def]
    """Return the angles, rad, from their cosines; NaN beyond -1 and 1."""
    return math.acos(x) if -1.0 <= x <= 1.0 else np.nan


@vectorize(cache=True)
def arctan2(y, x):  # type: ignore[no-untyped-def]
    """Return the angles, rad, of vectors from their parts."""
    return math.atan2(y, x)


def times(points: FloatArray, matrix: FloatArray) -> FloatArray:
    """Return (..., 2) points times a (2, m) matrix: ``points @ matrix``."""
    return points[..., :1] * matrix[0] + points[..., 1:] * matrix[1]
