"""From a contract and positions to a verdict and a certified plan, and edits of such plans."""
