"""The detector whose name has the deciding model asked where things are; see `Context.asks`."""

from ...errors import ToolError
from ..detection import Detection
from ..image import Picture
from ..segmenters.protocol import Pixels


class VlmDetector:
    """Stand-in for that model where it cannot be asked: outside of a turn."""

    name = "vlm"

    def detect(self, picture: Picture) -> tuple[()]:
        """See `Detector.detect`: without words it finds nothing."""
        return ()

    def find(self, pixels: Pixels, phrase: str) -> tuple[Detection, ...]:
        """See `Finder.find`.

        Raises:
            ToolError: always.
        """
        raise ToolError(f'There is no model here to be asked where "{phrase}" is; point at it.')
