"""Effects in the axes of a machine that turns with its rotor: what an inverter and its sensors make of three phases."""
