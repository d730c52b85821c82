"""Recordings: what a bench measured, read from many formats, checked and conditioned."""
