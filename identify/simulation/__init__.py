"""Simulation: a plant with its effects, compiled and driven over the rows of a recording."""
