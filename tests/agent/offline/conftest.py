"""A picture that several tests of the rules speak about."""

import numpy as np
import pytest
from formup.tools.perception.image import Picture, picture_from_array


@pytest.fixture(scope="session")
def picture() -> Picture:
    """A red disc at (250, 220) and a blue one at (560, 300), 45 and 40 px in radius."""
    pixels = np.full((432, 768, 3), 200, np.uint8)
    y, x = np.mgrid[:432, :768]
    discs = (((250, 220), 45, (200, 40, 40)), ((560, 300), 40, (40, 60, 210)))
    for (cx, cy), radius, colour in discs:
        pixels[(x - cx) ** 2 + (y - cy) ** 2 < radius**2] = colour
    return picture_from_array(pixels)
