"""Positions that satisfy a contract, computed from it and the outlines alone."""
