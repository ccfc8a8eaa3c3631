"""Graders: what a formation is worth, as success, as a share of robots, and in a sentence.

Beside the rule of the photographs (photo_rules.py), which says yes or no, these say how much is
right (the paper's GCR), by rules that make GCR = 1 and success the same thing. No model judges.
"""
