"""Plants: the equations of a machine, its parameters, and the effects that can be added to them."""
