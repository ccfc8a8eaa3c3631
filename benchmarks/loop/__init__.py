"""The agent loop's overhead beside bare HTTP and other agent frameworks."""
