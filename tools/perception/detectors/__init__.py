"""What is in a picture: things that stand out, found without trained weights."""
