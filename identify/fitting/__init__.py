"""Fitting: least squares, noise, covariance and intervals of a plant's parameters."""
