"""`formup serve` and `formup tokens`: serves the team over HTTP; manages who may reach it."""

from collections.abc import Generator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..agent.agent import Agent
from ..agent.service import Service
from ..agent.store.places import data_folder, store_at
from ..tools.context import check_settings
from ..tools.errors import InputError
from . import arguments
from . import options as o
from .agents import agent_of
from .terminal import say

if TYPE_CHECKING:
    from .server.settings import ServerSettings
    from .server.tokens import Tokens

NEEDED = "formup serve needs an extra that is not installed: pip install 'formup[serve]'."
TOKENS = "tokens.json"
LOOPBACK = ("127.0.0.1", "localhost", "::1")
tokens = typer.Typer(help="Manage who may use a server: names, scopes, hashed tokens.")
Host = Annotated[
    str | None, typer.Option(help="Address to listen on; default: 127.0.0.1, this machine only.")
]
Port = Annotated[int | None, typer.Option(help="Port to listen on; default: 8734.")]
TokensFile = Annotated[Path | None, typer.Option("--tokens", help="File of hashed tokens.")]
Models = Annotated[
    list[str] | None,
    typer.Option(
        "--model",
        help="Model that decides, as in formup run; repeatable, the first is the default.",
    ),
]
NewFleet = Annotated[
    str | None, typer.Option("--fleet", help="Fleet of new sessions: NAME, or a YAML FILE.")
]


def serve(
    host: Host = None,
    port: Port = None,
    tokens_file: TokensFile = None,
    store: o.StoreUrl = None,
    model: Models = None,
    base_url: o.BaseUrl = None,
    planner: o.PlannerName = None,
    prompt: o.PromptName = None,
    prompts: o.PromptsFolder = None,
    limit: o.LimitList = None,
    policy: o.PolicyList = None,
    fleet: NewFleet = None,
    detector: o.DetectorName = None,
    segmenter: o.SegmenterName = None,
    threshold: o.Threshold = None,
) -> None:
    """Serve the team over HTTP to browsers, chatbots and programs.

    It speaks an API of its own, OpenAI's API, and MCP.
    """
    try:
        from .server.run import run
        from .server.settings import ServerSettings
    except ModuleNotFoundError as error:
        if error.name not in ("fastapi", "uvicorn", "prometheus_client"):
            raise
        raise InputError(NEEDED) from None
    settings = ServerSettings.of(
        host=host,
        port=port,
        store=store,
        tokens_file=tokens_file,
        fleet=fleet,
        detector=detector,
        segmenter=segmenter,
        threshold=arguments.share("--threshold", threshold),
        model=model and ",".join(model),
    )
    usual = data_folder() / TOKENS
    if settings.tokens_file is None and usual.exists():
        settings = settings.model_copy(update={"tokens_file": usual})
    check_reach(settings)
    with service_of(settings, planner, base_url, prompt, prompts, limit, policy) as service:
        raise typer.Exit(run(service, settings))


@contextmanager
def service_of(settings: "ServerSettings", *rest: Any) -> Generator[Service]:
    """Yield the service of a server.

    Args:
        rest: options of its agents, as `agent_of` takes them.

    Raises:
        InputError: no session can begin with such settings.
    """
    check_settings(begun := settings.of_session())
    with ExitStack() as stack:
        agents: dict[str, Agent] = {}
        for name in map(str.strip, settings.model.split(",")):
            agents[name] = stack.enter_context(agent_of(name, *rest, talks=True))
            agents[name].check(begun)
        yield Service(agents, store_at(settings.store))


def check_reach(settings: "ServerSettings") -> None:
    """Refuse to listen beyond loopback without tokens.

    Raises:
        InputError: the host is not loopback and there are no tokens, or their file is missing.
    """
    if settings.host not in LOOPBACK and settings.tokens_file is None:
        raise InputError(
            f"On {settings.host} others can reach this server and its robots; create a token with "
            "formup tokens add NAME, or listen on 127.0.0.1."
        )
    if settings.tokens_file is not None and not settings.tokens_file.is_file():
        raise InputError(
            f"The token file {settings.tokens_file} does not exist, so nobody could get in; create "
            f"it with formup tokens add NAME --tokens {settings.tokens_file}."
        )


@tokens.command("add")
def add(
    name: Annotated[
        str, typer.Argument(help="Name of the owner: lowercase letters, digits, underscores.")
    ],
    scope: Annotated[
        str, typer.Option(help="What the token allows: read, plan, move or approve.")
    ] = "plan",
    file: TokensFile = None,
) -> None:
    """Create a token and print it; it cannot be shown again."""
    say(_tokens(file).add(name, scope))


@tokens.command("list")
def listed(file: TokensFile = None) -> None:
    """List the tokens: name, scope, date."""
    for entry in _tokens(file).entries():
        say(f"{entry.name}  {entry.scope}  since {entry.created}")


@tokens.command("remove")
def remove(
    name: Annotated[str, typer.Argument(help="Name of the owner.")], file: TokensFile = None
) -> None:
    """Revoke a token at once; sessions made with it are kept."""
    _tokens(file).remove(name)
    say(f"The token {name} is revoked.")


def _tokens(file: Path | None) -> "Tokens":
    """Return the tokens of a file, by default the server's or that of the user's data folder."""
    from .server.settings import ServerSettings
    from .server.tokens import Tokens

    path = file or ServerSettings.of().tokens_file or data_folder() / TOKENS
    path.parent.mkdir(parents=True, exist_ok=True)
    return Tokens(path)
