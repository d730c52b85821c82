"""An inertia on a bearing, moved by a torque: J dw/dt = T - b w."""

from __future__ import annotations

import math

from firmloop.identify.plants.kind import PlantConstant
from firmloop.identify.plants.stage import stage_kind, wide

KIND = stage_kind(
    "rotary_stage",
    "torque_N_m",
    wide("position_rad", "rad"),
    wide("speed_rad_s", "rad/s"),
    PlantConstant("J_kg_m2", "kg*m^2", 0.0, math.inf, open_low=True, guessable=False),
    PlantConstant("b_N_m_s_rad", "N*m*s/rad", 0.0, math.inf, open_low=False, guessable=False),
)
