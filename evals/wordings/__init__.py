"""Instructions worded by many people, and the model that is trained on them."""
