"""Effects between the commanded input and the input that acts."""
