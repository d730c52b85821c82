"""Check a certificate that a closed loop keeps its bounds for ever, in exact rational arithmetic."""
