"""Effects that enter a flow balance."""
