"""`formup serve`: the service over HTTP, for pages, chatbots, programs and MCP clients."""
