"""How good it is: suites of tasks, graders and the tables they print."""
