"""Drawn scenes with exact outlines, as many as wanted: graded pictures nothing was fitted to."""
