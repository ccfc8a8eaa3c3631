"""The paper's reinforcement-learning baseline: teams of robots around a target, and policies."""
