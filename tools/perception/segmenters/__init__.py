"""Segmenters: from a picture and a prompt to a mask with its confidence."""
