"""Discretize: from a continuous plant or transfer function to one in steps of the period."""
