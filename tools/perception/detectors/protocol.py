"""The interface of a detector: a picture goes in, candidates come out."""

from typing import Protocol

from ..image import Picture
from ..referring.attributes import Candidate


class Detector(Protocol):
    """A way to find things in a picture."""

    @property
    def name(self) -> str:
        """The name by which it is chosen."""
        ...

    def detect(self, picture: Picture) -> tuple[Candidate, ...]:
        """Find everything that stands out, as c1, c2, ... by falling salience; none is no error.

        `referring.measure_attributes.candidate_of` makes a candidate from an outline. Words of
        colour, size, place and shape are measured on it. A detector that knows nouns also
        implements `detection.Finder`, which is then used to find them.
        """
        ...
