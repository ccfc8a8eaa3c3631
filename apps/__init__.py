"""How people reach formup; everything is used here and nothing uses this."""
