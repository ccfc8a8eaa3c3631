"""Changes of a formation that stands, each certified anew."""
