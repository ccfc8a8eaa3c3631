"""What a request cost, by a dated price list; a model that is not on it costs 0."""

import re
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import yaml

_FILE = Path(__file__).with_name("prices.yaml")


@dataclass(frozen=True)
class Price:
    """US dollars per million tokens.

    Attributes:
        cached: for input read from the provider's cache.
        written: for input written to it.
    """

    input: float = 0.0
    cached: float = 0.0
    written: float = 0.0
    output: float = 0.0

    def cost(self, *, fresh: int, cached: int, written: int = 0, output: int) -> float:
        """Return the dollars for these token counts; `fresh` is input not read from or written to
        a cache.
        """
        spent = (
            fresh * self.input
            + cached * self.cached
            + written * self.written
            + output * self.output
        )
        return spent / 1e6


UNKNOWN = Price()


def price_of(provider: str, model: str) -> Price:
    """Return the price of a model by its name, with or without a date at the end, or `UNKNOWN`."""
    undated = re.sub(r"-\d{4}-?\d\d-?\d\d$", "", model)
    return _prices().get(f"{provider}:{undated}", UNKNOWN)


@cache
def _prices() -> dict[str, Price]:
    listed = yaml.safe_load(_FILE.read_text(encoding="utf-8"))["usd_per_million_tokens"]
    return {name: Price(**price) for name, price in listed.items()}
