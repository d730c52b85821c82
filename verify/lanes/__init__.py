"""Lanes of a program in compiled code of their own, which shares nothing with the C that it judges."""
