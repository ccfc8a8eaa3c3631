"""Contours to outlines to points: pure functions on immutable values, no I/O, no model."""
