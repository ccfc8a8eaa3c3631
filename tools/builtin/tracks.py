"""Files of where robots were on their way, from which films are made."""

import json
from contextlib import suppress

import numpy as np

from ..context import Context
from ..errors import StorageError
from ..fleet.arrival import Arrival, Track
from ..fleet.follow import Rigid
from ..fleet.protocol import Sighting
from ..tool import to_its_end
from ..world import World


async def with_track(context: Context, arrival: Arrival, track: Track) -> Arrival:
    """Return the arrival with its track stored, if it can be: a film is not worth failing for."""
    file, put = _track_file(track), context.services.artefacts.put
    with suppress(StorageError):
        stored = await to_its_end(lambda: put(file))
        return arrival.model_copy(update={"track": stored})
    return arrival


def _track_file(track: Track) -> bytes:
    """Return robots on their way as JSON, to a tenth of a pixel."""
    content = {"robots": track.ids, "points": np.round(track.points, 1).tolist()}
    content |= {"moved": np.round(track.moved, 3).tolist()} if len(track.moved) else {}
    return json.dumps(content, separators=(",", ":")).encode()


def read_track(data: bytes) -> Track:
    """Return the track in a file that a deployment left."""
    content = json.loads(data)
    moved = np.asarray(content.get("moved", ()), dtype=float).reshape(-1, 3)
    return Track(tuple(content["robots"]), np.asarray(content["points"], dtype=float), moved)


def moved_of(world: World, arrival: Arrival, track: Track) -> list[Rigid]:
    """Return how the thing that robots followed had moved at the last moments of a track."""
    if arrival.follow is None:
        return []
    name = arrival.follow.target
    centre = np.asarray(world.outline(name).centre)
    return [Rigid(centre, Sighting(name, *map(float, row))) for row in track.moved]
