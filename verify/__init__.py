"""Bundle in, verdict out."""
