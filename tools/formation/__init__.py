"""Contract and positions to a verdict, a certified plan and the motion that reaches it."""
