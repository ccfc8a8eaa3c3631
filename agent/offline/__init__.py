"""Rules in a language model's place: words to references, arrangements and tool calls."""
