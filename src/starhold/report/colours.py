"""The colours of laws."""

from __future__ import annotations

from colorsys import hls_to_rgb

COLOURS = (
    *("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#8A8A8A"),
    *("#7B3FA0", "#A6761D", "#E7298A", "#66A61E", "#4D5BD6", "#B3001B", "#2F8F9D"),
)
"""Okabe and Ito's palette, distinct to colour-blind readers, without what white or black paper swallows; then seven
more that differ from these and from one another."""
GOLDEN = 0.5 * (3.0 - 5.0**0.5)
"""Share of a full turn: hues that are such a step apart fill the circle evenly, however many they are."""


def colour(number: int) -> str:
    """The colour of the law at this place of a comparison, the same in every picture."""
    if number < len(COLOURS):
        return COLOURS[number]
    extra = number - len(COLOURS)
    red, green, blue = hls_to_rgb(GOLDEN * extra % 1.0, (0.38, 0.58)[extra % 2], 0.62)
    return "#" + "".join(f"{round(255.0 * part):02X}" for part in (red, green, blue))
