"""Masks that other programs made: from a file to the regions of things in a picture."""
