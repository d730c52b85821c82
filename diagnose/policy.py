"""Numbers that decide what is written and what is no explanation, each with its reason."""

from __future__ import annotations

# Do no harm. A free simulation from rest also carries what the fit gave to the initial states: figures that differ by
# less than this differ by chance (1 / sqrt(2 n) of an rms of 5,000 independent rows is 1 %).
SAME_RMS = 1.01

# Fits by plain simulation error, each with the sizes that the last one left: they stay after two or three.
REFITS, STEPS_OF_A_REFIT = 3, 24

# Share of a finite upper end of a parameter's range within which a fit ended on the bound and not in the data.
ON_BOUND = 1e-3

# A motor's torque and voltage constants are one constant in SI units: up to this much of log(kt / ke) apart they are
# meant to be, and the difference is the doubt of the scale of torques.
SAME_CONSTANT = 0.3

# BIC by which a short fit is too far behind to catch up, or has clearly gained.
CLEAR_GAIN = 150.0

# Steps of a trial, of a final fit, and of one that only follows a new noise model.
STEPS_OF_A_TRIAL, STEPS_OF_A_FIT, STEPS_OF_A_LAST_FIT = 3, 24, 4
