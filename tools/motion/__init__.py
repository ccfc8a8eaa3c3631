"""From poses and a plan to the paths that robots drive."""
