"""`formup serve`: serves the team over HTTP to pages, chatbots, programs and MCP clients."""
