"""The photographs that ship with formup, with outlines, tasks and success rules."""
