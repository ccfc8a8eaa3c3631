"""The interfaces through which people use formup: the top layer, which no other imports."""
