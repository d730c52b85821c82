"""Law in, exact program out."""
