"""Bench tests: step responses, standard motor tests, datasheets, excitation signals, black-box models."""
