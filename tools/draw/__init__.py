"""Pictures of scenes, plans and deployments; nothing is decided here."""

from .film import draw_deployment, save_gif
from .overlay import draw_look, draw_plan

__all__ = ["draw_deployment", "draw_look", "draw_plan", "save_gif"]
