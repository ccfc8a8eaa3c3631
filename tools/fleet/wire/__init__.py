"""What fleets have in common whose robots are elsewhere: poses come and goals go over a wire."""
