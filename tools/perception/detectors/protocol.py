"""What a detector is: a picture and perhaps a noun phrase go in, candidates come out."""

from typing import Protocol

from ..image import Picture
from ..referring.attributes import Candidate


class Detector(Protocol):
    """A way to find things in a picture."""

    @property
    def name(self) -> str:
        """What it is chosen by."""
        ...

    def detect(self, picture: Picture, phrase: str | None) -> tuple[Candidate, ...]:
        """The things found, with ids c1, c2, ... from the most salient one; none is no error.

        `referring.measure_attributes.candidate_of` makes a candidate of an outline.

        Args:
            picture: as the person sees it.
            phrase: a bare noun phrase such as "red car", or None for everything that stands out.
                A detector that knows no words returns everything; words of colour, size, place
                and shape are then measured on what it found.
        """
        ...
