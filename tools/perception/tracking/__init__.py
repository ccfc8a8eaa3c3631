"""Where a thing that was measured once is by now, from frame to frame of a fixed camera."""
