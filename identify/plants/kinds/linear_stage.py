"""A mass on a guide, moved by a force: m dv/dt = F - b v."""

from __future__ import annotations

import math

from firmloop.identify.plants.kind import PlantConstant
from firmloop.identify.plants.stage import stage_kind, wide

KIND = stage_kind(
    "linear_stage",
    "force_N",
    wide("position_m", "m"),
    wide("speed_m_s", "m/s"),
    PlantConstant("mass_kg", "kg", 0.0, math.inf, open_low=True, guessable=False),
    PlantConstant("b_N_s_m", "N*s/m", 0.0, math.inf, open_low=False, guessable=False),
)
