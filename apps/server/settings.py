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
        default="127.0.0.1", description="address to listen on; beyond loopback it wants tokens"
    )
    port: int = Field(
        default=8734, ge=0, le=65535, description="port to listen on; 0 takes a free one"
    )
    store: str | None = Field(
        default=None,
        description="where sessions are kept: a folder, sqlite:///FILE or postgresql://...",
    )
    tokens_file: Path | None = Field(
        default=None, description="file with hashed tokens, as `formup tokens` writes it"
    )
    model: str = Field(
        default="offline", description="who decides, as PROVIDER:NAME; several split by commas"
    )
    fleet: str = Field(
        default="simulated",
        description="the robots of new sessions: a fleet's name, or a YAML file",
    )
    detector: str = Field(default="standout", description="how new sessions find things")
    segmenter: str = Field(default="grabcut", description="how new sessions make outlines")
    threshold: float | None = Field(
        default=None, ge=0, le=1, description="least confidence that a mask of theirs is used at"
    )
    reports: Path | None = Field(
        default=None, description="folder of reports, HTML files, that the page lists"
    )
    origins: str = Field(
        default="",
        description="other origins whose pages may call it, as https://HOST, split by commas",
    )
    hosts: str = Field(default="", description="other names of this server, split by commas")
    public_url: str = Field(
        default="",
        description="address that browsers reach it by, where it is not the one it is called by",
    )
    upload_bytes: int = Field(default=32_000_000, ge=1_000, description="most bytes of a request")
    pixels: int = Field(default=40_000_000, ge=100, description="most pixels of a picture")
    sessions: int = Field(default=1_000, ge=1, description="most sessions of one token")
    requests: int = Field(
        default=256, ge=1, description="most requests of one token at the same time"
    )
    requests_per_minute: int = Field(
        default=6_000, ge=1, description="most of one token in a minute"
    )
    streams: int = Field(
        default=1_200, ge=1, description="most event streams open at the same time"
    )
    body_seconds: float = Field(
        default=30, gt=0, description="longest that a request may take to arrive"
    )
    shutdown_seconds: float = Field(
        default=3, gt=0, description="longest that requests have at the end"
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
