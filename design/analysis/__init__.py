"""Analysis: a law and a plant in closed loop, its margins, its metrics and their uncertainty."""
