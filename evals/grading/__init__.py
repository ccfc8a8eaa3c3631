"""Graders: they judge a formation by success, by a share of robots, and in a sentence.

The share of robots is the paper's GCR; the rules make GCR = 1 the same as success. No model
judges.
"""
