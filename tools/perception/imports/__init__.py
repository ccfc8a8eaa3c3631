"""Masks made by other programs: from a file to the regions of things in a picture."""
