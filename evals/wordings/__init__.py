"""Instructions in the words of many people, and the model that is trained on them."""
