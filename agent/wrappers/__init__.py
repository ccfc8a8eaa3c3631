"""Models around a model or in its place: replay, two stages, tracing, scripted doubles."""
