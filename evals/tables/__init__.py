"""The paper's tables, and one of our own: their definitions, and our results for their cells."""
