"""Restores a conversation from its events, so that a service can go on with it."""

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
    """Return a conversation as far as it has come, perhaps before anything was said.

    Args:
        events: all its events.
        agents: the service's agents by name; the first decides if the conversation's own is gone.
        picture: its picture, if that is no longer stored with it.
        services: what tools use beside the world.

    Raises:
        InputError: the conversation is damaged, or the picture is another.
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
