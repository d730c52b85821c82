"""Bench: what is measured and read off before there is a controller."""
