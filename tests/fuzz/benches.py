"""Draw what is done at a bench, a data sheet, an excitation, a fit, with odd numbers, units and keys in its project."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache

import numpy as np
from hypothesis import strategies as st

from tests.fuzz.projects import odd

PLANT = '[plant]\nkind = "{kind}"\ninput = "{input}"\noutputs = ["{output}"]\n'
SHEET = """nominal_voltage = "24 V"
no_load_speed = "8000 rpm"
no_load_current = "50 mA"
stall_torque = "100 mNm"
stall_current = "3.6 A"
terminal_resistance = "6.6 ohm"
terminal_inductance = "0.5 mH"
torque_constant = "28 mNm/A"
speed_constant = "341 rpm/V"
rotor_inertia = "12 gcm^2"
mechanical_time_constant = "10 ms"
tolerance = 0.05
"""
PLAY = 'low = -6\nhigh = 6\nperiod_s = 0.01\nduration_s = 5\nrepeats = 2\nrest_s = 0.5\nsignal = "{signal}"\n'
SIGNALS = {
    "prbs": "order = 7\nclock_s = 0.05\n",
    "chirp": "low_Hz = 0.5\nhigh_Hz = 10\n",
    "multisine": "low_Hz = 0.5\nhigh_Hz = 10\nlines = 12\n",
    "ramps": "cycles = 3\n",
    "steps": "levels = 5\nhold_s = 0.5\n",
}
HEATER = (
    '[recordings]\ntrain = ["heat.csv"]\nperiod_s = 1.0\nstart_s = 0.0\n[recordings.conditioning]\n'
    'remove_offset = ["heater_percent"]\ndetrend = ["temperature_C"]\nsavgol_window = 5\nsavgol_order = 2\n'
    "line_Hz = 0.1\nresample_s = 2.0\nwindow_s = 100.0\n"
    + PLANT.format(kind="first_order", input="heater_percent", output="temperature_C")
    + "[plant.parameters]\ngain = { value = 0.5, free = true }\ntime_constant_s = { value = 15.0, free = true }\n"
    "delay_s = { value = 1.0, free = true }\noutput_at_rest = { value = 0.0, free = true }\n"
)


def bench_projects() -> Mapping[str, tuple[str, ...]]:
    """The sound projects of each verb."""
    head = 'schema = 1\nname = "x"\n'
    motor = PLANT.format(kind="dc_motor", input="voltage_V", output="speed_rad_s")
    plays = (f"{head}[experiment]\n{PLAY.format(signal=name)}{keys}" for name, keys in SIGNALS.items())
    return {
        "datasheet": (f"{head}{motor}[datasheet]\n{SHEET}",),
        "excite": tuple(plays),
        "identify": (head + HEATER,),
        "model": (f'{head}{HEATER}[model]\nstructure = "oe"\norder = 1\ndelay_samples = 1\n',),
    }


@cache
def heat() -> str:
    """A recording of the heater."""
    random = np.random.default_rng(1)
    drive = np.repeat(random.choice([0.0, 40.0], 8), 25)
    level, rows = 0.0, ["time_s,heater_percent,temperature_C"]
    for k, u in enumerate(drive):
        rows.append(f"{k},{u:g},{level + 0.05 * random.standard_normal():.6g}")
        level += (1.0 - np.exp(-1.0 / 20.0)) * (0.6 * u - level)
    return "\n".join(rows) + "\n"


@st.composite
def odd_benches(draw: st.DrawFn) -> tuple[str, str]:
    """Draw a verb and a project of it with one or two odd values."""
    verb = draw(st.sampled_from(("datasheet", "datasheet", "excite", "excite", "identify", "model")))
    return verb, odd(draw, draw(st.sampled_from(bench_projects()[verb])), (1, 1, 2))
