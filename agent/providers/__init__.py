"""Language models by name: OpenAI, Anthropic, Gemini, Ollama, and servers that speak their APIs."""
