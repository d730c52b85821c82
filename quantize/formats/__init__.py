"""Formats: one number format per value, and per table."""
