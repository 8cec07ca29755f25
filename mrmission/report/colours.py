"""One colour per robot, told apart by people with any common colour vision.

Both palettes are farthest-first picks in CIELAB: every next colour is the one whose smallest
distance to those before it is largest, over normal vision and simulated protanopia, deuteranopia
and tritanopia (Machado, Oliveira, Fernandes 2009; Viénot, Brettel, Mollon 1999). The first eight
stay at least 18 apart (Delta E 1976) in each of the four, all 32 at least 7. Lightness is bounded
so that lines stand out on the page: 22-60 on light, 50-92 on dark. A number on the map goes with
every colour, because 32 colours are not told apart by colour alone with comfort.
"""

from __future__ import annotations

LIGHT = (
    "#005ab4", "#f05a0f", "#691e2d", "#a587a5", "#c3695a", "#4b3c69", "#870f00", "#874bff",
    "#2d0fa5", "#0096d2", "#965a69", "#5a0078", "#c32d0f", "#963c3c", "#875a96", "#7878f0",
    "#6900e1", "#783c5a", "#b47878", "#e1694b", "#782dd2", "#0078c3", "#781e1e", "#693c87",
    "#b43c2d", "#873c4b", "#003ca5", "#786987", "#a55a5a", "#8787b4", "#a57887", "#4b2d4b",
)  # fmt: skip
"""Colours on a light page, robot 1 first."""

DARK = (
    "#5ab4ff", "#ff871e", "#f0e1c3", "#967887", "#785aff", "#b4694b", "#b4e1ff", "#ffb478",
    "#f00fc3", "#c3a587", "#c35a00", "#6987ff", "#5aff4b", "#78c3b4", "#e1874b", "#d2f0a5",
    "#b4b4d2", "#2dd2ff", "#d29669", "#8787d2", "#a57869", "#9687a5", "#e1d200", "#e1782d",
    "#5afff0", "#5ad2a5", "#c3d296", "#c3693c", "#c3c34b", "#8769b4", "#3c96f0", "#f01e87",
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
