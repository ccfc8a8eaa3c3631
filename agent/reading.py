"""A conversation as a service goes on with it, from its events."""

from collections.abc import Mapping, Sequence

from ..tools.context import Services
from ..tools.perception.image import Picture
from .agent import Agent
from .conversation import Session
from .session import load_run, stored_picture
from .session_start import Opening
from .store.protocol import Event, StoredSession


def read_conversation(
    stored: StoredSession,
    events: Sequence[Event],
    agents: Mapping[str, Agent],
    picture: Picture | None,
    services: Services,
) -> Session:
    """A conversation as far as it has come, perhaps before anything was said.

    Args:
        events: all there are.
        agents: of the service by their names; the first one decides where its own is not there.
        picture: where it is not stored beside it any more.
        services: what tools use beside the world.

    Raises:
        InputError: it is damaged, or the picture is another.
    """
    first = events[0].data
    opening = Opening.model_validate(first.get("opening") or {})
    agent = agents.get(opening.agent) or next(iter(agents.values()))
    if any(event.kind == "message" for event in events):
        run = load_run(stored, picture, services)
        picture, settings = run.context.picture, run.context.settings
        return Session(agent, picture, settings, stored=stored, services=services, run=run)
    return Session(
        agent,
        stored_picture(first["picture"], stored.artefacts, picture),
        opening.settings,
        opening.pointed,
        opening.keep_out,
        stored,
        begun=len(events),
        services=services,
    )
