"""What is asked of drawn scenes beyond their own task: each recipe makes an entry from a seed."""
