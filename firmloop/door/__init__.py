"""Door: what `import firmloop` offers, one function a file, each with the noun that it returns."""
