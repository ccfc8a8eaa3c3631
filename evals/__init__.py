"""Evaluation: suites of tasks, graders, and the tables of their results."""
