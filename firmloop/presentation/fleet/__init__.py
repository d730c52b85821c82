"""What a fleet says, for people and machines: in words, as a page, as a table of columns."""
