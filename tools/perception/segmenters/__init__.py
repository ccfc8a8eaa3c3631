"""A prompt and a picture to a mask with its confidence."""
