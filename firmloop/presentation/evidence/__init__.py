"""What is filed as evidence, as words and as a page."""
