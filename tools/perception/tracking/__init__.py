"""Tracks a thing that was measured once, from frame to frame of a fixed camera."""
