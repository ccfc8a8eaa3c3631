"""Where conversations are stored: append-only logs of numbered events, and files by hash."""
