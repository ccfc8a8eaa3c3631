"""Resolves words for a thing by what is measured of it: attributes, relations, ranks."""
