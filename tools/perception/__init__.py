"""Picture to candidates to masks to outlines, without learned weights."""
