"""Discrepancy: what has no name, smoothed out of the recordings and fitted as a shape over a coordinate."""
