"""Procedurally drawn scenes with exact outlines: any number of pictures nothing was fitted to."""
