"""Quadratic programs of predictive control: condensed, partitioned and solved."""
