"""Measurements of how exact outlines are, and how reliable the confidence in them is."""
