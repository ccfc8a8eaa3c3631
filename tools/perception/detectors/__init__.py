"""Detectors of things in a picture: those that stand out, or those that a network finds by name."""
