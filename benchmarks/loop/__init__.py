"""The overhead of the agent loop, beside bare HTTP and other agent frameworks."""
