"""Words for a thing, decided on what is measured of it: attributes, relations, ranks."""
