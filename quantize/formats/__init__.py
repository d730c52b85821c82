"""Formats: a problem rounded to a number format, as a table of the Program, and read back for its twin."""
