"""Effects that enter a voltage balance."""
