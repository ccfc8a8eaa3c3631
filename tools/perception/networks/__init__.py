"""Trained networks: where their checkpoints come from, and how they are run."""
