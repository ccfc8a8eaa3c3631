"""Tells specks from things: what is tiny among its kind takes no part in a rank or a count.

A crumb beside nine sweets is as round as they are, and would be the smallest or the tenth.
"""

import numpy as np

from .filters import NO, SURE, Filter, IntArray, Things, listed

TINY, TINY_IN_PICTURE = 0.25, 0.05
"""A speck is this small beside the middle one of its kind, and in the picture; lengths, roots of
areas."""
SMALL, SMALL_IN_PICTURE = 0.5, 0.025
"""So is one that is half as large as the middle one where it is a dot in the picture."""


def specks_among(things: Things, degrees: IntArray) -> IntArray:
    """Return the indices of specks among the things that fit by their degrees (n,).

    What surely fits is the measure, if anything does. Where all are small, none is a speck.
    """
    fitting = np.flatnonzero(degrees > NO)
    sizes = np.sqrt(things.areas)
    kind = sizes[degrees == SURE] if (degrees == SURE).any() else sizes[fitting]
    if not len(kind):
        return fitting
    beside = sizes[fitting] / np.median(kind)
    in_picture = sizes[fitting] / np.sqrt(things.width * things.height)
    tiny = (beside < TINY) & (in_picture < TINY_IN_PICTURE)
    small = (beside < SMALL) & (in_picture < SMALL_IN_PICTURE)
    return fitting[tiny | small]


def speck_filter(things: Things, specks: IntArray) -> Filter:
    """Return the filter that leaves specks (indices) out."""
    degrees = np.full(len(things.candidates), SURE, dtype=np.int64)
    degrees[specks] = NO
    return Filter("no speck", degrees, lambda i: "")


def specks_note(things: Things, specks: IntArray, degrees: IntArray) -> str:
    """Say which things were left out as specks of those that fit by degrees; empty if none was."""
    if not len(specks):
        return ""
    kept = np.setdiff1d(np.flatnonzero(degrees > NO), specks)
    across = np.sqrt(things.areas)
    named, are = listed(things.candidates, specks), "are" if len(specks) > 1 else "is"
    return (
        f"{named} {are} left out as too small to be one of them: {across[specks].max():.0f} px "
        f"across at most, where the middle one of the others has {np.median(across[kept]):.0f}"
    )
