"""Colours stay apart for common colour vision."""

from __future__ import annotations

import numpy as np
import pytest

from mrmission.report.colours import DARK, LIGHT, robot_colour

RGB_TO_LMS = np.array(
    [[0.31399022, 0.63951294, 0.04649755], [0.15537241, 0.75789446, 0.08670142],
     [0.01775239, 0.10944209, 0.87256922]]
)  # fmt: skip
# Viénot, Brettel, Mollon 1999, on the LMS of Hunt-Pointer-Estevez as given by Cutler.
MISSING = {
    "protan": np.array([[0, 1.05118294, -0.05116099], [0, 1, 0], [0, 0, 1]]),
    "deutan": np.array([[1, 0, 0], [0.9513092, 0, 0.04866992], [0, 0, 1]]),
    "tritan": np.array([[1, 0, 0], [0, 1, 0], [-0.86744736, 1.86727089, 0]]),
}


def linear(palette):
    rgb = np.array([[int(c[i : i + 2], 16) for i in (1, 3, 5)] for c in palette]) / 255
    return np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)


def lab(rgb):
    matrix = np.array(
        [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750],
         [0.0193339, 0.1191920, 0.9503041]]
    )  # fmt: skip
    xyz = rgb @ matrix.T / [0.95047, 1.0, 1.08883]
    f = np.where(xyz > 216 / 24389, np.cbrt(xyz), (24389 / 27 * xyz + 16) / 116)
    return np.column_stack(
        [116 * f[:, 1] - 16, 500 * (f[:, 0] - f[:, 1]), 200 * (f[:, 1] - f[:, 2])]
    )


def seen(palette, vision):
    rgb = linear(palette)
    if vision == "normal":
        return lab(rgb)
    lms = rgb @ RGB_TO_LMS.T @ MISSING[vision].T
    return lab(np.clip(lms @ np.linalg.inv(RGB_TO_LMS).T, 0, 1))


def closest(colours):
    apart = np.linalg.norm(colours[:, None] - colours[None, :], axis=2)
    return apart[np.triu_indices(len(colours), 1)].min()


@pytest.mark.parametrize("palette", [LIGHT, DARK], ids=["light", "dark"])
@pytest.mark.parametrize("vision", ["normal", "protan", "deutan", "tritan"])
def test_robots_can_be_told_apart(palette, vision):
    assert len(set(palette)) == 32
    colours = seen(palette, vision)
    assert closest(colours[:8]) >= 18
    assert closest(colours) >= 7


@pytest.mark.parametrize(("palette", "page"), [(LIGHT, "#eef6fa"), (DARK, "#0e2029")])
def test_lines_stand_out_on_the_water(palette, page):
    luminance = linear(palette) @ [0.2126729, 0.7151522, 0.0721750]
    water = float((linear([page]) @ [0.2126729, 0.7151522, 0.0721750])[0])
    high, low = np.maximum(luminance, water), np.minimum(luminance, water)
    assert ((high + 0.05) / (low + 0.05)).min() >= 2.9


def test_colours_repeat_above_32():
    assert robot_colour(33) == robot_colour(1)
    assert robot_colour(33, dark=True) == DARK[0]
