"""Benchmarks of formup beside the bare library calls; not part of the wheel."""
