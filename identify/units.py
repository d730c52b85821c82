"""Read the unit of a quantity out of the end of its name."""

from __future__ import annotations

# Longest ending first, so that torque_N_m is not read as metres.
_ENDINGS = (
    ("_N_m_s_rad", "N*m*s/rad"),
    ("_V_s_rad", "V*s/rad"),
    ("_N_m_A", "N*m/A"),
    ("_N_s_m", "N*s/m"),
    ("_kg_m2", "kg*m^2"),
    ("_rad_s", "rad/s"),
    ("_N_m", "N*m"),
    ("_m_s", "m/s"),
    ("_N_m_s2_rad2", "N*m*s^2/rad^2"),
    ("_K_per_W", "K/W"),
    ("_ohm", "ohm"),
    ("_rad", "rad"),
    ("_kg", "kg"),
    ("_Hz", "Hz"),
    ("_V", "V"),
    ("_A", "A"),
    ("_N", "N"),
    ("_H", "H"),
    ("_F", "F"),
    ("_K", "K"),
    ("_m", "m"),
    ("_C", "degC"),
    ("_s", "s"),
)


def unit_of(name: str) -> str:
    """Return the unit that `name` ends in (`speed_rad_s` -> `rad/s`), empty where the ending is none we know."""
    return next((unit for ending, unit in _ENDINGS if name.endswith(ending)), "")


def ending_of(name: str) -> str:
    """Return the unit as it is spelled in `name` (`speed_rad_s` -> `rad_s`), empty where the ending is none we know."""
    return next((ending[1:] for ending, _ in _ENDINGS if name.endswith(ending)), "")
