"""Who decides: messages, models, the loop, its limits and outcomes."""
