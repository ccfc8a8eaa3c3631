"""Pictures of scenes, plans and deployments. This package only draws; it decides nothing."""

from .film import draw_deployment
from .overlay import draw_look, draw_plan
from .recording import FILMS, save_film, save_gif
from .view import draw_view, view_scale

__all__ = [
    "FILMS",
    "draw_deployment",
    "draw_look",
    "draw_plan",
    "draw_view",
    "save_film",
    "save_gif",
    "view_scale",
]
