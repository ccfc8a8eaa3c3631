"""Trials of methods over suites: running, storing, comparing, gating and promoting."""
