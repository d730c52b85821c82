"""Find a certificate that a closed loop keeps its bounds for ever; a judge checks it."""
