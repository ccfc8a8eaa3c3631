"""Counts, intervals, tests and power for results of trials."""
