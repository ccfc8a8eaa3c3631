"""What a detector is: a picture goes in, candidates come out."""

from typing import Protocol

from ..image import Picture
from ..referring.attributes import Candidate


class Detector(Protocol):
    """A way to find things in a picture."""

    @property
    def name(self) -> str:
        """What it is chosen by."""
        ...

    def detect(self, picture: Picture) -> tuple[Candidate, ...]:
        """Everything that stands out, as c1, c2, ... from the most salient one; none is no error.

        `referring.measure_attributes.candidate_of` makes a candidate of an outline. Words of
        colour, size, place and shape are measured on it. A detector that knows nouns is a
        `detection.Finder` as well, which is asked for them.
        """
        ...
