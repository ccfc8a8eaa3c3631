"""The paper's baseline of reinforcement learning: teams of robots about a target, and policies."""
