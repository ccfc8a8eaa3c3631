"""The paper's tables, and one of our own: what their cells are, and what came of them here."""
