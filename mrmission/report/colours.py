"""One colour per robot, told apart by people with any common colour vision.

Both palettes are farthest-first picks in CIELAB: every next colour is the one whose smallest
distance to those before it is largest, over normal vision and simulated protanopia, deuteranopia
and tritanopia (Machado, Oliveira, Fernandes 2009). So the first few are far apart and all 32 stay
at least 10 apart (Delta E 1976) in each of the four. Lightness is bounded so that lines stand out
on the page: 22-60 on light, 50-92 on dark. A number on the map goes with every colour, because no
32 colours are told apart by colour alone with comfort.
"""

from __future__ import annotations

LIGHT = (
    "#005ab4", "#d2780f", "#5a2d2d", "#a587a5", "#7800ff", "#b4785a", "#3c2d5a", "#782d00",
    "#f02dff", "#2d0fa5", "#b43c69", "#7869a5", "#b4692d", "#5a0078", "#874b3c", "#9678d2",
    "#4b3cd2", "#4b87ff", "#b40087", "#a500b4", "#3c0fd2", "#692d1e", "#00695a", "#a58778",
    "#875a2d", "#4b2d3c", "#a52dff", "#964b00", "#4b4b78", "#003c96", "#5a3c5a", "#964bd2",
)  # fmt: skip
"""Colours on a light page, robot 1 first."""

DARK = (
    "#5ab4ff", "#ffc300", "#78875a", "#c3f0f0", "#4b69ff", "#e1e196", "#b4780f", "#e100a5",
    "#e187a5", "#b4a55a", "#00e1ff", "#0087b4", "#b4c396", "#f0a53c", "#5a8778", "#965ad2",
    "#a5ff69", "#d2f0d2", "#c3a5d2", "#2d96ff", "#e1c369", "#96783c", "#e169d2", "#87ff3c",
    "#b4d2c3", "#ff3c87", "#00b4a5", "#87a569", "#c3963c", "#e1b4d2", "#f01e3c", "#d2e1b4",
)  # fmt: skip
"""Colours on a dark page, robot 1 first."""


def robot_colour(robot: int, *, dark: bool = False) -> str:
    """Return the colour of a robot, ``#rrggbb``.

    Parameters
    ----------
    robot
        Number of the robot, counted from 1. Above 32 the colours repeat.
    dark
        For a dark page.

    Returns
    -------
    str
        The colour.

    Examples
    --------
    >>> robot_colour(1)
    '#005ab4'
    """
    palette = DARK if dark else LIGHT
    return palette[(robot - 1) % len(palette)]
