"""Build: the images and libraries that are compared, and what they occupy."""
