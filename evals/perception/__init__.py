"""How exact outlines are, and what the confidence in them is worth."""
