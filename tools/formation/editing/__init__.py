"""Edits of an existing formation, each certified anew."""
