"""`formup mcp`: serves the team to any Model Context Protocol client, over stdio and HTTP."""
