"""Plan to observed poses: the fleets that move robots, and arrival as it was observed."""
