"""Computes positions that satisfy a contract from it and the outlines alone."""
