"""Poses and a plan to paths that robots drive."""
