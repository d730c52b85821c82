"""Stimuli: inputs that make a controller show its differences."""
