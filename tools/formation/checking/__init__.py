"""Checks positions against a contract and reports every violation at once, with numbers."""
