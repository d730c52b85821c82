"""Proofs: claims on a program judged a second time, each by a file that knows nothing of what it judges."""
