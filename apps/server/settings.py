"""The settings of a server, read from variables FORMUP_ and the name of a field, in capitals."""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Self

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from ...tools.context import Settings
from ...tools.errors import InputError

PREFIX = "FORMUP_"


class ServerSettings(BaseModel):
    """Settings of `formup serve`; the command line wins over the environment."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    host: str = Field(
        default="127.0.0.1", description="address to listen on; any but loopback requires tokens"
    )
    port: int = Field(
        default=8734, ge=0, le=65535, description="port to listen on; 0 picks a free one"
    )
    store: str | None = Field(
        default=None,
        description="where sessions are stored: a folder, sqlite:///FILE or postgresql://...",
    )
    tokens_file: Path | None = Field(
        default=None, description="file of hashed tokens, as `formup tokens` writes it"
    )
    model: str = Field(
        default="offline",
        description="model that decides, as PROVIDER:NAME; separate several by commas",
    )
    fleet: str = Field(
        default="simulated",
        description="fleet of new sessions: a name, or a YAML file",
    )
    detector: str = Field(default="standout", description="detector of new sessions")
    segmenter: str = Field(default="grabcut", description="segmenter of new sessions")
    threshold: float | None = Field(
        default=None,
        ge=0,
        le=1,
        description="minimum confidence for a mask to be used in new sessions",
    )
    reports: Path | None = Field(
        default=None, description="folder of HTML reports that the page lists"
    )
    origins: str = Field(
        default="",
        description="other origins whose pages may call it, as https://HOST; separate several by "
        "commas",
    )
    hosts: str = Field(
        default="", description="other host names of the server; separate several by commas"
    )
    public_url: str = Field(
        default="",
        description="address at which browsers reach the server, if clients call it by another one",
    )
    upload_bytes: int = Field(
        default=32_000_000, ge=1_000, description="maximum size of a request in bytes"
    )
    pixels: int = Field(default=40_000_000, ge=100, description="maximum pixels of a picture")
    sessions: int = Field(default=1_000, ge=1, description="maximum sessions per token")
    requests: int = Field(default=256, ge=1, description="maximum simultaneous requests per token")
    requests_per_minute: int = Field(
        default=6_000, ge=1, description="maximum requests per minute per token"
    )
    streams: int = Field(
        default=1_200, ge=1, description="maximum event streams open at the same time"
    )
    body_seconds: float = Field(
        default=30, gt=0, description="maximum seconds for a request to arrive"
    )
    shutdown_seconds: float = Field(
        default=3, gt=0, description="maximum seconds for requests to finish at shutdown"
    )

    def of_session(self, **given: Any) -> Settings:
        """Return the settings of a new session, including those given for it."""
        names = ("fleet", "detector", "segmenter", "threshold")
        return Settings(**{name: getattr(self, name) for name in names}, **given)

    @classmethod
    def of(cls, environment: Mapping[str, str] = os.environ, **given: object) -> Self:
        """Return the settings of an environment; those given, and not None, override it.

        Raises:
            InputError: a value is not valid.
        """
        named = {n: environment.get(PREFIX + n.upper()) for n in cls.model_fields}
        values = {n: v for n, v in named.items() if v} | {
            n: v for n, v in given.items() if v is not None
        }
        try:
            return cls.model_validate(values)
        except ValidationError as error:
            first = error.errors()[0]
            name = PREFIX + str(first["loc"][0]).upper()
            raise InputError(f"{name} is {first['input']!r}: {first['msg'].lower()}.") from None
