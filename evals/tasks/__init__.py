"""Suites of tasks as YAML files, with their JSON Schema; pictures are drawn when a suite is run."""
