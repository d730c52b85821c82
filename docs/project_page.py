"""Write docs/reference/project.md: every key of a project file, as firmloop itself lists them.

The keys are not typed here: each table is read with a key that does not exist, and the complaint lists the known ones.
Only the sentence beside a key stands below; a key without a sentence, or a sentence without a key, is an error.
"""

from __future__ import annotations

import re
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path

from firmloop.design.tuning import rules
from firmloop.identify.bench_tests.excitations import excitation, excitations
from firmloop.identify.plants.plant_table import plant_from_table
from firmloop.identify.recordings.conditioning import conditioning_from_table
from firmloop.project.project import Project, read_project
from firmloop.stages.bench.black_box import black_box
from firmloop.stages.progress import quietly
from firmloop.stages.tuning import compare

NO_KEY = "qqqqqqqqqq"  # near no key there is, so that the complaint lists them all
LISTS = ("known here: ", "known keys: ", "known: ", " has ")
HEAD = 'schema = 1\nname = "x"\n'
LOOP = '[controller]\nkind = "pid"\nperiod_s = 0.01\n'
ENTRY = {
    "value": "in the unit that ends the name",
    "free": "`true`: `identify` and `diagnose` may change it (default)",
    "low": "least value a fit may give it",
    "high": "greatest value a fit may give it",
    "ci95": "95 % interval, `[low, high]`; written by `identify`",
}
SENTENCES: Mapping[str, Mapping[str, str]] = {
    "Top level": {
        "schema": "must be 1",
        "name": "names the C symbols: a C identifier in small letters",
        "recordings": "the files to fit and to score",
        "plant": "the physical model",
        "controller": "the control law",
        "signals": "the physical range of every controller input and output",
        "arithmetic": "the number format of the C",
        "target": "what the C is built for and run on",
        "tuning": "`firmloop tune`: which rules to compare",
        "datasheet": "`firmloop datasheet`: figures as printed, with their units",
        "standard_tests": "`firmloop datasheet`: readings of the standard bench tests",
        "experiment": "`firmloop excite`: the excitation signal",
        "model": "`firmloop model`: structure and order of a black-box model",
    },
    "[recordings]": {
        "train": "files that are fitted; paths are relative to the project file",
        "test": "files that are only scored, never fitted",
        "rename": "table: a file's column name = the name firmloop uses, or a table, see below; for every file",
        "conditioning": "table, see below",
        "hold": '`"zero_order"` (default: the input of a row is held until the next row), `"linear"`, `"band_limited"`',
        "period_s": "time between two rows, s, where the file has no time column or its stamps are rounded",
        "start_s": "time of the first row, s, with `period_s` (default 0)",
        "per_recording": "values of the plant that may differ from file to file: `load_torque_N_m` or `load_force_N`, "
        "`zero.OUTPUT`, `gain.OUTPUT`, or a parameter by its full name; each file gets its own, with an interval, and "
        "the project that is written holds the mean of train",
    },
    "[recordings.rename] COLUMN = { ... }": {
        "name": "the name firmloop uses; it ends in the unit of the values",
        "unit": "unit of the column as a maker prints it: `rpm`, `ms`, `mA`, `oz-in`; converted to that of the name",
        "scale": "factor of the column's numbers, before `unit` (default 1)",
        "offset": "what is added after `scale`, in `unit` (default 0)",
        "wraps": "by how much a counter falls when it starts anew, in the column's own numbers: 4294967296, 65536",
    },
    "[recordings.conditioning]": {
        "remove_offset": "signals that lose their mean; an input loses it before it drives the model",
        "detrend": "outputs that lose their best straight line",
        "align": "outputs whose clock may differ from that of the input; the difference is fitted",
        "savgol_window": "rows of a Savitzky-Golay filter, odd; 0 is none (default)",
        "savgol_order": "its order (default 2)",
        "line_harmonics": "how many multiples of `line_Hz` are removed (default 5)",
        "resample_s": "period of the grid on which outputs are compared, s; default: the rows as they are",
        "align_max_lag_s": "largest clock difference that `align` looks for, s",
        "window_s": "length of windows that each get an initial state of their own, s; for plants that integrate",
        "line_Hz": "mains frequency to be removed, Hz",
    },
    "[plant]": {
        "kind": "one of the [plant kinds](plants.md)",
        "input": "the column that drives the plant",
        "inputs": "instead of `input`, the columns of a plant that several drive together: see its kind",
        "outputs": "the columns that it answers with",
        "parameters": "table, see below",
        "effects": "array of tables, see below",
        "force_per_unit": "`linear_stage` behind a drive signal: N per unit of the input",
        "torque_per_unit": "`rotary_stage` behind a drive signal: N m per unit of the input",
    },
    '[plant] with kind = "ode"': {
        "kind": '`"ode"`',
        "states": "names of the states",
        "inputs": "names of the inputs",
        "outputs": "table: column = expression of states, inputs and parameters",
        "derivatives": "table: state = expression of its time derivative",
        "balances": "table: which derivative is a balance that effects may act on; left out: those that units tell",
        "parameters": "table, see below",
        "effects": "array of tables, see below",
    },
    "[plant.balances.STATE]": {
        "kind": '`"torque"`, `"force"`, `"voltage"` or `"flow"`',
        "per": "what the balance is multiplied by to give the derivative, such as `1/m_kg`",
        "position": "state that is the position",
        "speed": "state that is the speed",
        "effort": "expression of the torque or force of the drive",
        "current": "expression of the current behind it",
        "resistance": "expression of the resistance that heat may change",
        "to": "flow: the state that receives what flows over; left out: the one that the state itself runs into",
    },
    "[plant.parameters] NAME = { ... }": ENTRY,
    "[[plant.effects]] PARAMETER = { ... }": {key: says for key, says in ENTRY.items() if key not in ("low", "high")},
    "[signals] NAME = { ... }": {
        "unit": "as text, at most 24 ASCII characters",
        "low": "least value in that unit; what fixed point is proven for",
        "high": "greatest value in that unit",
    },
    "[arithmetic]": {
        "number": '`"float32"`, `"float64"` or `"fixed"`',
        "bits": "16 or 32, with `fixed`; left out with a `max_error_UNIT`: the shorter one that keeps it",
        "rounding": '`"nearest"` (default) or `"floor"`, with `fixed`',
    },
    "[target]": {"names": "names from [targets](targets.md), or paths of target files"},
    "[tuning]": {
        "rules": "which to compare (default: all)",
        **{
            name: f"table: {', '.join(f'`{key}`' for key in rule.keys) or 'it has no keys'}"
            for name, rule in rules().items()
        },
    },
    "[model]": {
        "structure": '`"arx"`, `"oe"` (default) or `"n4sid"`',
        "order": "1 to 12 (default 2)",
        "delay_samples": "whole samples of delay (default: searched)",
    },
    "[experiment]": {
        "signal": "one of the names below",
        "low": "least value of the signal",
        "high": "greatest value",
        "period_s": "time between samples, s",
        "duration_s": "length of the signal, s",
        "repeats": "how often it is played",
        "rest_s": "rest between two repeats, s",
    },
}
AFTER = {
    "[recordings]": """A column name that firmloop does not know is mapped in `[recordings.rename]`:

```toml
[recordings.rename]
motor_voltage = "voltage_V"
t_us = { name = "time_s", unit = "us", wraps = 4294967296 }
rpm = { name = "speed_rad_s", unit = "rpm" }
adc = { name = "current_A", unit = "mA", scale = 0.8, offset = -1650 }
```

A plain name changes the name only, not the numbers. A column whose own name carries another unit (`t_ms`,
`Speed [rpm]`) cannot be renamed plainly: the complaint shows the line to write. A counter is unwrapped first; then
number * scale + offset is a value in `unit`.

Text files may have commas, semicolons, tabs or spaces between columns, decimal commas, units in a line
or behind each reading, lines before the header, a delimiter at every line's end, a byte order mark, or UTF-16. Dates
and times of day are read as seconds
from the first, days of spreadsheets and MATLAB as days; a column of two words such as ON and OFF is 1 and 0, other
columns of words are left aside. A line may be a row, a signal with all its values, or one value beside its name and
time, and a table of several rates may have empty cells. Exports of Tektronix, Rigol, Siglent, Keysight and Saleae, rows
below
settings that say how far apart they are (Yokogawa, Hantek, Owon, Fluke), Graphtec's recorders, LabVIEW's `.lvm`, the
stamps of a terminal (`12:00:01.250 -> 3.2,17.4`), objects of JSON a line and lines that name each value
(`t_ms:12,speed:3.5`) are read too. With an extra
of the installation: `hdf5` for `.h5` and MATLAB 7.3, `tdms`, `mdf4` (`.mf4`), `ulog` (`.ulg`), `mcap`, `rosbag`
(`.bag`, `.db3`), `parquet`. Groups or topics with different rates are held on the instants of the quickest; groups with
the same names are two recordings. What is not plain is told in a note; a file with two readings is refused.""",
    "[[plant.effects]] PARAMETER = { ... }": """An entry has `name`, the parameters of that
[effect](effects.md), and where there is a choice the place it acts at: `output` for sensor effects (which reading;
default: the first), `at` for others (the state of a balance, such as `at = "w2_rad_s"`; a plant with one body needs
none, an `ode` with several has to say). A place that is not used is an error, and the order of entries changes nothing.
A bare number is a fixed value:

```toml
[[plant.effects]]
name = "coulomb_friction"
torque_N_m = 1.2e-4
```""",
    "[arithmetic]": """`max_error_UNIT = VALUE` (for instance `max_error_V = 0.01`) is the largest rounding error
allowed in one step of every output in that unit; a program beyond it is refused.""",
    "[signals] NAME = { ... }": """Every signal is an input of the controller, in the order of the file, except those
that `controller.outputs` names.""",
}


def project_page() -> str:
    """Return the page; AssertionError names a key that has no sentence, or a sentence whose key is gone."""
    parts = [
        "# The project file",
        "One TOML file holds everything a command needs. A project may hold only the parts that its command needs: "
        "`diagnose` needs no controller, `generate` no recordings. An unknown key is an error "
        "that names the nearest known one. The keys of `[controller]` belong to its kind: see "
        "[controllers](controllers.md).",
    ]
    found = keys_by_table()
    assert set(found) == set(SENTENCES), "docs/project_page.py: each table is asked for its keys and has its sentences"
    for title, keys in found.items():
        says = SENTENCES[title]
        for key in keys:
            assert key in says, f"docs/project_page.py: {title} has a key {key!r} without a sentence; write one"
        for key in says:
            assert key in keys, f"docs/project_page.py: {title} has no key {key!r} any more; remove its sentence"
        rows = "\n".join(f"| `{key}` | {says[key]} |" for key in keys)
        parts.append(f"## {title.replace('[', chr(92) + '[')}\n\n| key | meaning |\n|---|---|\n{rows}")
        if title in AFTER:
            parts.append(AFTER[title])
    parts.append(_signals_table())
    return "\n\n".join(parts) + "\n"


def known_keys(read: Callable[[], object]) -> tuple[str, ...]:
    """Return the keys that the complaint about `NO_KEY` lists."""
    try:
        read()
    except Exception as error:
        message = str(error)
        assert NO_KEY in message, message
        begin = next(mark for mark in LISTS if mark in message)
        return tuple(dict.fromkeys(re.findall(r"\w+", message.rpartition(begin)[2])))
    raise AssertionError(f"a key {NO_KEY!r} was accepted")


def keys_by_table() -> Mapping[str, tuple[str, ...]]:
    """Return the keys of each table of a project, as the complaints about a key that does not exist list them."""
    motor = {
        "kind": "dc_motor",
        "input": "voltage_V",
        "outputs": ["speed_rad_s"],
        "parameters": {name: 1.0 for name in ("R_ohm", "L_H", "ke_V_s_rad", "kt_N_m_A", "J_kg_m2", "b_N_m_s_rad")},
    }
    text = {"kind": "ode", "states": ["x"], "inputs": ["u"], "outputs": {"y": "x"}, "derivatives": {"x": "u"}}
    odd = {"value": 1.0, NO_KEY: 1}
    spare = f"{NO_KEY} = 1\n"
    asked: Mapping[str, Callable[[], object]] = {
        "Top level": lambda: _read(spare),
        "[recordings]": lambda: _read(f"[recordings]\n{spare}"),
        "[recordings.rename] COLUMN = { ... }": lambda: _read(f"[recordings.rename]\nrpm = {{ {NO_KEY} = 1 }}\n"),
        "[recordings.conditioning]": lambda: conditioning_from_table({NO_KEY: 1}),
        "[plant]": lambda: _read(f"[plant]\n{spare}"),
        '[plant] with kind = "ode"': lambda: _read(f'[plant]\nkind = "ode"\n{spare}'),
        "[plant.balances.STATE]": lambda: plant_from_table({**text, "balances": {"x": {"kind": "force", NO_KEY: 1}}}),
        "[plant.parameters] NAME = { ... }": lambda: plant_from_table(
            {**motor, "parameters": {**motor["parameters"], "R_ohm": odd}}  # type: ignore[dict-item]
        ),
        "[[plant.effects]] PARAMETER = { ... }": lambda: plant_from_table(
            {**motor, "effects": [{"name": "coulomb_friction", "torque_N_m": odd}]}
        ),
        "[signals] NAME = { ... }": lambda: _read(f"[signals]\nreference = {{ {NO_KEY} = 1 }}\n"),
        "[arithmetic]": lambda: _read(f"[arithmetic]\n{spare}"),
        "[target]": lambda: _read(f"[target]\n{spare}"),
        "[tuning]": lambda: compare(_read(f"{LOOP}[tuning]\n{spare}"), plant_from_table(motor), ()),
        "[model]": _model,
        "[experiment]": lambda: excitation({"signal": _plainest_signal(), NO_KEY: 1}),
    }
    found = {title: known_keys(read) for title, read in asked.items()}
    own = excitations()[_plainest_signal()].keys
    return {**found, "[experiment]": tuple(key for key in found["[experiment]"] if key not in own)}


def _plainest_signal() -> str:
    return min(excitations(), key=lambda name: (len(excitations()[name].keys), name))


def _read(text: str) -> Project:
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "project.toml"
        file.write_text(HEAD + text)
        return read_project(file)


def _model() -> object:
    """Run `firmloop model` on a project whose `[model]` holds an unknown key."""
    plant = '[plant]\nkind = "first_order"\ninput = "voltage_V"\noutputs = ["speed_rad_s"]\n'
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "project.toml"
        data = Path(folder) / "a.csv"
        data.write_text("time_s,voltage_V,speed_rad_s\n0,0,0\n")
        file.write_text(f'{HEAD}[recordings]\ntrain = ["a.csv"]\n{plant}[model]\n{NO_KEY} = 1\n')
        return black_box(read_project(file), quietly)


def _signals_table() -> str:
    rows = "\n".join(
        f"| `{name}` | {', '.join(f'`{key}`' for key in kind.keys) or 'none'} |" for name, kind in excitations().items()
    )
    return f"The signals of `[experiment]` and their own keys:\n\n| signal | keys |\n|---|---|\n{rows}"
