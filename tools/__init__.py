"""What can be done with a picture and a team of robots; knows no model."""
