"""How fast it is, measured beside the bare library calls; not part of the wheel."""
