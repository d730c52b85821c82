"""Data: recordings checked, unrolled and made ready before any effect is searched for."""
