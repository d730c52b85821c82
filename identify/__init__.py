"""Measured data in, plant out: recordings, plant kinds, the compiled simulator, and the fit."""
