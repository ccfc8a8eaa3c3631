"""`formup mcp`: the team for any client of the Model Context Protocol, over stdio and HTTP."""
