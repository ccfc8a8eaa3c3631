"""Recipes for further tasks on drawn scenes: each one makes an entry from a seed."""
