"""Effects between an output and what is recorded of it."""
