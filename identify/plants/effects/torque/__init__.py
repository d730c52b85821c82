"""Effects that enter a torque or force balance."""
