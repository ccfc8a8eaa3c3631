"""Cameras above a floor: what they see now, and where on the floor that is."""
