"""Pictures of scenes, plans and deployments; nothing is decided here."""

from .film import draw_deployment, save_gif
from .overlay import draw_look, draw_plan
from .view import draw_view, view_scale

__all__ = ["draw_deployment", "draw_look", "draw_plan", "draw_view", "save_gif", "view_scale"]
