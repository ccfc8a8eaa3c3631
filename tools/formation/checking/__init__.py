"""Positions against a contract: every violation at once, with numbers."""
