"""Bound closed loops for all time, and hold each bound against the worst that a search finds.

Run it as `python -m bench.proofs.for_ever`: twelve loops of a controller in fixed point and a plant whose parameters
lie in intervals. For each a certificate is looked for and judged. The search draws plants, most at the ends of their
intervals, lets the reference jump as is worst for each (the signs of its impulse response, backwards), and runs the
program itself. Prints a row a loop: bound, worst found, their ratio; ends with 1 where a bound is missing, below what
was found, or more than twice of it. Two minutes on two cores.
"""

from __future__ import annotations

import json
import sys
import tempfile
import time
from collections.abc import Mapping
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from firmloop.door.generate import Code, generate
from firmloop.door.load import load
from firmloop.stages.forever.certificate import certificate
from firmloop.stages.forever.rest import numbers
from firmloop.verify.judgement import PROVEN
from firmloop.verify.proofs.claims import Claims
from firmloop.verify.proofs.forever.check import plant_of_part
from firmloop.verify.proofs.forever.ring import REFERENCE, close
from firmloop.verify.proofs.forever.stated import ShownPart, read_stated
from firmloop.verify.proofs.judge import Delivered
from firmloop.verify.proofs.judges import every_judge
from firmloop.verify.proofs.reading import read_claims
from firmloop.verify.reference import Machine

Array = NDArray[np.float64]

DRAWS, LONGEST, SEED = 12, 3000, 1
LARGEST_RATIO = 2.0

_TEXT = """\
schema = 1
name = "{name}"
[plant]
{plant}
[controller]
{controller}
[signals]
reference = {{ unit = "{unit}", low = -{span}, high = {span} }}
measurement = {{ unit = "{unit}", low = -{span}, high = {span} }}
output = {{ unit = "V", low = -12, high = 12 }}
[arithmetic]
number = "fixed"
bits = {bits}
rounding = "{rounds}"
[target]
names = ["host"]
"""


def _parameters(**intervals: tuple[float, float]) -> str:
    """Write parameters with their value and half width."""
    rows = []
    for name, (value, half) in intervals.items():
        known = f", ci95 = [{value - half!r}, {value + half!r}]" if half else ""
        rows.append(f"{name} = {{ value = {value!r}, free = {'true' if half else 'false'}{known} }}")
    return "\n".join(rows)


def _motor(share: float) -> str:
    values = {"R_ohm": 7.4, "L_H": 1.1e-3, "ke_V_s_rad": 0.0213, "J_kg_m2": 3.3e-6, "b_N_m_s_rad": 3.6e-6}
    rows = _parameters(**{name: (value, share * value) for name, value in values.items()}, kt_N_m_A=(0.0213, 0.0))
    return f'kind = "dc_motor"\ninput = "voltage_V"\noutputs = ["speed_rad_s"]\n[plant.parameters]\n{rows}'


def _lag(kind: str, unit: str, **intervals: tuple[float, float]) -> str:
    output = {"rad/s": "speed_rad_s", "degC": "temperature_degC"}[unit]
    return (
        f'kind = "{kind}"\ninput = "voltage_V"\noutputs = ["{output}"]\n[plant.parameters]\n{_parameters(**intervals)}'
    )


def _loop(
    name: str,
    plant: str,
    controller: str,
    unit: str = "rad/s",
    span: int = 600,
    bits: int = 32,
    rounds: str = "nearest",
) -> tuple[str, str]:
    text = _TEXT.format(name=name, plant=plant, controller=controller, unit=unit, span=span, bits=bits, rounds=rounds)
    return name, text


PI = 'kind = "pid"\nperiod_s = {period}\nkp = {kp}\nki = {ki}'
LEAD = 'kind = "lead_lag"\nperiod_s = 0.001\ngain = 0.1\nzero_rad_s = 60.0\npole_rad_s = 600.0'
FILTER = (
    'kind = "transfer_function"\nperiod_s = 0.002\nnumerator = [0.002, 0.04]\ndenominator = [0.02, 1.0]\ndomain = "s"'
)
MATRICES = 'kind = "state_space"\nperiod_s = 0.001\nA = [[0.9]]\nB = [[0.1, -0.1]]\nC = [[0.04]]\nD = [[0.01, -0.01]]'
AT_ONCE = (0.0, 0.0)  # a delay or a time constant that is not there
OVEN = _lag(
    "process",
    "degC",
    gain=(20.0, 0.3),
    time_constant_s=(120.0, 1.5),
    second_time_constant_s=(8.0, 0.2),
    zero_time_constant_s=AT_ONCE,
    delay_s=AT_ONCE,
)
RESONANCE = _lag(
    "second_order",
    "rad/s",
    gain=(30.0, 0.2),
    natural_frequency_rad_s=(60.0, 0.3),
    damping_ratio=(0.4, 0.004),
    delay_s=AT_ONCE,
)
LAG = _lag("first_order", "rad/s", gain=(45.0, 0.5), time_constant_s=(0.05, 0.001), delay_s=AT_ONCE)
LATE = _lag("first_order", "rad/s", gain=(45.0, 0.4), time_constant_s=(0.05, 0.0005), delay_s=(0.0071, 0.0003))
MOTOR = _motor(0.005)
LOOPS: Mapping[str, str] = dict(
    [
        _loop("motor_pi", MOTOR, PI.format(period=0.001, kp=0.03, ki=1.2)),
        _loop("motor_pi_16_bits", MOTOR, PI.format(period=0.001, kp=0.03, ki=1.2), bits=16),
        _loop("motor_pi_wide", _motor(0.02), PI.format(period=0.001, kp=0.02, ki=0.8)),
        _loop("motor_pid", MOTOR, PI.format(period=0.001, kp=0.03, ki=1.2) + "\nkd = 1e-5\ntf_s = 0.003"),
        _loop("motor_lead", MOTOR, LEAD),
        _loop("lag_pi", LAG, 'kind = "pid"\nperiod_s = 0.002\ntune = "simc"\ntau_c_s = 0.02'),
        _loop("delay_pi", LATE, 'kind = "pid"\nperiod_s = 0.002\ntune = "simc"\ntau_c_s = 0.03'),
        _loop("oven_pi", OVEN, 'kind = "pid"\nperiod_s = 1.0\ntune = "simc"\ntau_c_s = 30.0', unit="degC", span=200),
        _loop("resonance_integral", RESONANCE, PI.format(period=0.002, kp=0.002, ki=0.6)),
        _loop("resonance_lead", RESONANCE, FILTER),
        _loop("motor_state_space", MOTOR, MATRICES),
        _loop("motor_floor", MOTOR, PI.format(period=0.001, kp=0.01, ki=0.5), rounds="floor"),
    ]
)


def made(text: str, folder: Path) -> tuple[Code, Claims, Any]:
    """Return the controller of a project's text, its claims and the certificate that is found."""
    path = folder / "project.toml"
    path.write_text(text)
    code = generate(load(path))
    claims = read_claims(json.loads(json.dumps(code.generated.proof)))
    document = certificate(code.project, code.design, code.plant, code.program, claims)
    return code, claims, json.loads(json.dumps(document))


def worst_found(code: Code, claims: Claims, document: Any, draws: int = DRAWS, seed: int = SEED) -> float:
    """Return the largest |error| that drawn plants and their worst references give of the program as it runs."""
    stated, random = read_stated(document), np.random.default_rng(seed)
    worst = 0.0
    for k in range(draws):
        part = stated.parts[int(random.integers(len(stated.parts)))]
        share = (
            np.full(len(part.box), 0.5) if k == 0 else random.choice([0.0, 0.5, 1.0], len(part.box), p=[0.4, 0.2, 0.4])
        )
        point = tuple(
            (low + (high - low) * Fraction(float(s)),) * 2 for (low, high), s in zip(part.box, share, strict=True)
        )
        worst = max(worst, _worst_of(code, claims, document, part, point))
    return worst


def _worst_of(code: Code, claims: Claims, document: Any, part: ShownPart, point: Any) -> float:
    stated = read_stated(document)
    plant = plant_of_part(claims, stated, point, part.modes)
    ring = close(claims, stated, part.rest, plant) if len(part.rest) == _size(claims, stated, plant) else None
    if ring is None:
        return 0.0
    matrix = np.array([[float(x) for x in row] for row in ring.matrix])
    column = np.array([float(x) for x in ring.columns[REFERENCE]])
    row = np.array([float(x) for x in ring.error.vector])
    steps = min(part.steps, LONGEST)
    response = [float(ring.error.direct[REFERENCE])]
    for _ in range(steps - 1):
        response.append(float(row @ column))
        row = row @ matrix
    signs = np.where(np.array(response)[::-1] >= 0, 1.0, -1.0)
    reference = float(stated.rest_reference) + float(stated.reach) * signs
    return _run(code, stated, part, plant, reference)


def _size(claims: Claims, stated: Any, plant: Any) -> int:
    ages = max((*plant.taps, *plant.reads), default=0)
    return len(plant.a) + ages * len(stated.drives) + len(claims.state) - len(claims.parameters)


def _run(code: Code, stated: Any, part: ShownPart, plant: Any, reference: Array) -> float:
    """Run program and plant from rest and return the largest |error|."""
    program, machine = code.program, Machine(code.program)
    a, taps = numbers(plant.a), {age: numbers(rows) for age, rows in plant.taps.items()}
    c, read_x, read_c = numbers([plant.c])[0], numbers(plant.read_x), numbers([plant.read_c])[0]
    reads = {age: numbers(rows) for age, rows in plant.reads.items()}
    count, ages = len(stated.drives), max((*taps, *reads), default=0)
    rest = np.array([float(x) for x in part.rest])
    x, past = rest[: len(a)], rest[len(a) : len(a) + ages * count].reshape(ages, count)
    words = [np.array([round(w)]) for w in rest[len(a) + ages * count :]] + [
        np.array([start]) for start in program.start[len(program.start) - len(program.tunable) :]
    ]
    names = [value.name for value in program.outputs]
    worst = 0.0
    for r in reference:
        y = read_x @ x + read_c + sum((rows @ past[age - 1] for age, rows in reads.items()), np.zeros(len(read_c)))
        told = []
        for value in program.inputs:
            seen = float(r) if value.name == stated.reference else 0.0
            seen = float(y[stated.measured[value.name]]) if value.name in stated.measured else seen
            # The bound is of any real reference within its reach: what the program reads is the nearest inside of it.
            raw = (
                np.trunc(seen * 2.0**value.number.fraction)
                if value.name == stated.reference
                else np.floor(seen * 2.0**value.number.fraction + 0.5)
            )
            told.append(np.array([int(np.clip(raw, value.low, value.high))]))
            if value.name == stated.reference:
                r = raw * 2.0**-value.number.fraction
        worst = max(worst, abs(float(r) - float(y[0])))
        values = machine.step(told, words)
        u = np.array(
            [
                float(np.ravel(values[machine.results[names.index(n)]])[0])
                * 2.0 ** -program.outputs[names.index(n)].number.fraction
                for n in stated.drives
            ]
        )
        words = [np.broadcast_to(values[name], 1) for name in machine.next]
        older = np.vstack([u, past])
        x = a @ x + c + sum((rows @ older[age] for age, rows in taps.items()), np.zeros(len(a)))
        past = older[:ages]
    return worst


def main() -> int:
    """Print the rows."""
    failed = 0
    for name, text in LOOPS.items():
        with tempfile.TemporaryDirectory() as folder:
            begin = time.perf_counter()
            code, claims, document = made(text, Path(folder))
            searched = time.perf_counter() - begin
            judged = every_judge()["for_ever"].judge(Delivered(claims, None, document))
            if judged.result != PROVEN:
                print(f"{name:20} {judged.result}: {judged.says}", flush=True)
                failed = 1
                continue
            bound, worst = float(document["error"]), worst_found(code, claims, document)
            failed |= not worst <= bound <= LARGEST_RATIO * worst
            print(
                f"{name:20} reach {float(document['reach']):9.4g}  bound {bound:9.4g}  found {worst:9.4g}  ratio "
                f"{bound / worst:5.3f}  parts {len(document['parts']):3}  {searched:5.1f} s + {judged.seconds:5.1f} s",
                flush=True,
            )
    return failed


if __name__ == "__main__":
    sys.exit(main())
