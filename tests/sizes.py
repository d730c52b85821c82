"""A usual size of every effect of the contract, on a small motor and on a carriage."""

from __future__ import annotations

from types import MappingProxyType

from firmloop.identify.plants.attach import parameters_of
from firmloop.identify.plants.effects import candidates
from firmloop.identify.plants.kinds import make_plant
from firmloop.identify.plants.plant import EffectUse, Plant

MOTOR = {
    "R_ohm": 8.0, "L_H": 1e-3, "ke_V_s_rad": 0.02, "kt_N_m_A": 0.02, "J_kg_m2": 3e-6, "b_N_m_s_rad": 3e-6,
}  # fmt: skip
STAGE = {"mass_kg": 2.0, "b_N_s_m": 4.0}
ROTARY = {
    "torque_N_m": 1e-3, "coulomb_N_m": 1e-3, "static_N_m": 2e-3, "stribeck_rad_s": 10.0, "positive_N_m": 1e-3,
    "negative_N_m": 2e-3, "ratio": 0.05, "stiffness_N_m_rad": 0.05, "coefficient_N_m_s2_rad2": 1e-8, "time_s": 0.1234,
    "amplitude_N_m": 1e-3, "phase_rad": 0.3, "periods_per_rev": 8.0, "position_rad": 3.0, "low_rad": -3.0,
    "high_rad": 3.0, "cubic_N_m_rad3": 1e-4,
    "load_inertia_kg_m2": 2e-6, "damping_N_m_s_rad": 1e-5, "gap_rad": 0.02, "current_A": 1.0, "rise_K_per_W": 10.0,
    "time_constant_s": 0.01, "voltage_V": 0.5, "half_width_V": 0.3, "limit_V": 5.0, "rate_V_s": 500.0,
    "delay_s": 2.3e-3, "source_ohm": 0.5, "offset_rad_s": 2.0, "gain": 1.1, "resolution_rad_s": 1.0,
    "limit_rad_s": 150.0, "range_rad_s": 200.0, "amplitude_rad": 0.01,
    "offset_rad": 0.05, "resolution_rad": 1e-3, "limit_rad": 5.0, "range_rad": 4.0,
    "offset_A": 0.1, "resolution_A": 0.01, "limit_A": 1.0, "range_A": 1.0,
}  # fmt: skip
LINEAR = {
    "force_N": 1.0, "coulomb_N": 1.0, "static_N": 2.0, "stribeck_m_s": 0.01, "positive_N": 1.0, "negative_N": 2.0,
    "ratio": 0.05, "stiffness_N_m": 20.0, "coefficient_N_s2_m2": 3.0, "time_s": 0.1234, "amplitude_N": 1.0,
    "phase_rad": 0.3, "periods_per_m": 30.0, "position_m": 0.02, "low_m": -0.02, "high_m": 0.02,
    "cubic_N_m3": 1e4, "load_mass_kg": 0.5,
    "damping_N_s_m": 5.0, "gap_m": 1e-3, "half_width_N": 0.5, "limit_N": 8.0, "rate_N_s": 2e3, "delay_s": 2.3e-3,
    "offset_m": 0.01, "gain": 1.1, "resolution_m": 1e-4, "limit_m": 0.05, "range_m": 0.1, "time_constant_s": 0.01,
    "slope": 0.1,
}  # fmt: skip


def motor(*outputs: str) -> Plant:
    """Make a small motor."""
    return make_plant("dc_motor", "voltage_V", list(outputs), MOTOR)


def stage(*outputs: str) -> Plant:
    """Make a carriage."""
    return make_plant("linear_stage", "force_N", list(outputs), STAGE)


def use_of(plant: Plant, name: str) -> EffectUse:
    """Return the effect at its usual size; the names of its parameters depend on the plant."""
    sizes = ROTARY if any(balance.kind == "torque" for balance in plant.balances) else LINEAR
    known = parameters_of(plant, name)
    values = {p.name: sizes[p.name] for p in known if p.name in sizes}
    missing = [p.name for p in known if p.name not in sizes and p.default is None]
    assert not missing, f"give {missing} of {name} a size"
    return EffectUse(name, None, MappingProxyType(values))


EFFECTS_OF_A_MOTOR = tuple(effect.name for effect in candidates(motor("speed_rad_s", "position_rad", "current_A")))
EFFECTS_OF_A_STAGE = tuple(effect.name for effect in candidates(stage("position_m", "speed_m_s")))
