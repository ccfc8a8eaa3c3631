"""Letters, polygons, stars and other figures as strokes and outlines."""
