"""Effects on the time stamps of the outputs."""
