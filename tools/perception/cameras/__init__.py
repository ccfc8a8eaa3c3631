"""Cameras above a floor: what they see now, and where that is on the floor."""
