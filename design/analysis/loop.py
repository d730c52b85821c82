"""Close the loop of a law and a linear plant: margins and trajectory.

The plant is sampled exactly (`discretize.py`), the law is linearized for the margins (`small_signal.py`) and run as it
is, limits included, for the trajectory. With C(z) the way from the measurement to the output of the law, the loop is
L(z) = -C(z) P(z).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np
import numpy.typing as npt
import scipy

from firmloop.design.analysis.small_signal import LinearLaw, linearize_law
from firmloop.design.analysis.stabilizing import leaving, stabilizing
from firmloop.design.discretize import unit_circle
from firmloop.design.discretize.zero_order_hold import Sampled, state_space, zero_order_hold
from firmloop.design.law import Law
from firmloop.design.optimum import QuadraticSolver, Solution
from firmloop.design.outcome import CAPPED, INFEASIBLE
from firmloop.design.quadratic.solver import solver
from firmloop.design.roles import reference_and_measurement
from firmloop.identify.simulation.linearize import Linear

Array = npt.NDArray[np.float64]
Response = npt.NDArray[np.complex128]

LONGEST, LONGEST_SEARCHED = 50_000, 5_000  # samples of a step: a search takes as long as many plain samples
MOST_WORK = 5_000_000  # samples of a step times the states of plant and law, past inputs included
BLOCK = 500  # samples run at one go: what builds a run of n samples takes n log n, and takes it once for a block
SLOWEST = 1 - 1e-9  # a pole above it counts as one at rest
LAGS = 12  # time constants of the slowest mode after which a loop rests
AT_REST = 1e-9  # an open loop's pole this close to z = 1 counts as an integrator
ON_CIRCLE = 1e-12  # a pole this close to the unit circle is not called stable: rounding may have put it there
STAYS = 0.05  # of a step: the wider of the two bands that it settles in


@dataclass(frozen=True, slots=True)
class Margins:
    """How far the loop is from instability; infinite where no change of that sort reaches it.

    Of an unstable loop the gain margin is the least change that makes it stable (negative dB: the gain must fall), NaN
    where none does; the phase margin is what is missing at the nearest crossing, NaN where nothing is; the delay margin
    is 0 and the sensitivity peak infinite. `crossover_rad_s` is NaN where |L| never passes 1.
    """

    stable: bool
    gain_margin_db: float  # by which the gain may rise
    gain_reduction_db: float  # by which the gain may fall, as a positive number
    phase_margin_deg: float
    delay_margin_s: float
    sensitivity_peak: float  # Ms = max |1/(1 + L)|
    crossover_rad_s: float  # where the phase margin is taken
    stable_turned: bool = False  # an unstable loop that is stable with the sign of its gain turned


@dataclass(frozen=True, slots=True)
class Trajectory:
    """The closed loop sample by sample, each array (n,); `measurement` is read before `output` acts."""

    time: Array  # s
    reference: Array
    measurement: Array
    output: Array
    saturated: npt.NDArray[np.bool_]  # a flag of the law is raised

    @property
    def off(self) -> bool:
        """Whether the measurement ends farther than 5 % of the step from the reference."""
        asked, came = float(self.reference[-1]), float(self.measurement[-1])
        return abs(asked - came) > STAYS * abs(asked)

    @property
    def held_back(self) -> bool:
        """Whether it ends there and the output at its limit."""
        return bool(self.saturated[-1]) and self.off


def loop_response(law: Law, linear: Linear, frequency: Array) -> Response:
    """Return L(exp(j w h)) at the frequencies w (n,) in rad/s."""
    return _response(law, *_both(law, linear))(frequency)


def closed_loop_poles(law: Law, linear: Linear) -> Response:
    """Find the poles in the z plane of the linearized law around the sampled plant."""
    return unit_circle.poles(_ring(law, *_both(law, linear)))


def settles(law: Law, linear: Linear) -> bool:
    """Tell whether the linearized law around the sampled plant comes to rest."""
    return unit_circle.within(_ring(law, *_both(law, linear)), 1 - ON_CIRCLE)


def margins(law: Law, linear: Linear) -> Margins:
    """Measure the loop broken at the plant's first input; the measurement is the plant's first output."""
    linearized, sampled = _both(law, linear)
    ring = _ring(law, linearized, sampled)
    poles, stable = unit_circle.poles(ring), unit_circle.within(ring, 1 - ON_CIRCLE)
    response = _response(law, linearized, sampled)
    opened = np.concatenate([unit_circle.poles(sampled.a), unit_circle.poles(linearized.a)])
    grid = _grid(np.concatenate([poles, opened]), law.period, sampled.whole)
    loop = response(grid)

    turns = _phase_crossings(response, grid, loop)
    if np.all(np.abs(opened - 1) > AT_REST) and response(np.zeros(1))[0].real < 0:
        turns.append(0.0)
    gains = [1 / abs(response(np.array([w]))[0]) for w in turns]
    crossovers = _roots(lambda w: abs(response(np.array([w]))[0]) - 1, grid, np.abs(loop) - 1)
    phases = [
        math.degrees(np.angle(-response(np.array([w]))[0])) for w in crossovers
    ]  # 180 deg + angle, in (-180, 180]
    nearest = min(range(len(phases)), key=lambda k: abs(phases[k]), default=None)
    phase = math.inf if nearest is None else phases[nearest]
    if not stable:
        left = [leaving(response, w, math.pi / law.period) for w in turns]
        rise = _decibel(stabilizing(gains, left, lambda factor: _holds(law, linearized, sampled, factor)))
        fall = -rise if rise < 0 else math.inf
        phase = phase if phase < 0 else math.nan
    else:
        rise = _decibel(min((factor for factor in gains if factor > 1), default=math.inf))
        fall = -_decibel(max((factor for factor in gains if factor < 1), default=0.0))
    return Margins(
        stable=stable,
        gain_margin_db=rise,
        gain_reduction_db=fall,
        phase_margin_deg=abs(phase) if stable else phase,
        delay_margin_s=min(
            (math.radians(p % 360) / w for p, w in zip(phases, crossovers, strict=True)), default=math.inf
        )
        if stable
        else 0.0,
        sensitivity_peak=_sensitivity_peak(response, grid, loop) if stable else math.inf,
        crossover_rad_s=math.nan if nearest is None else crossovers[nearest],
        stable_turned=not stable and _holds(law, linearized, sampled, -1.0),
    )


def _holds(law: Law, linearized: LinearLaw, sampled: Sampled, factor: float) -> bool:
    """Tell whether the loop is stable with `factor` times its gain."""
    scaled = replace(linearized, c=factor * linearized.c, d=factor * linearized.d)
    return unit_circle.within(_ring(law, scaled, sampled), 1 - ON_CIRCLE)


def step_profile(law: Law, linear: Linear) -> Array:
    """Make the reference (n,) of a step from 0 to a quarter of its range.

    It lasts as many samples as `samples_to_rest` says, as far as LONGEST and MOST_WORK go.
    """
    reference, _ = reference_and_measurement(law.inputs)
    signal = law.inputs[reference]
    top = signal.high if signal.high >= -signal.low else signal.low
    poles = closed_loop_poles(law, linear)
    longest = min(LONGEST if law.solve is None else LONGEST_SEARCHED, MOST_WORK // max(1, len(poles)))
    return np.full(min(_samples_to_rest(poles), longest), top / 4)


def samples_to_rest(law: Law, linear: Linear) -> int:
    """Return twelve time constants of the slowest mode of the linearized loop, at least 200, in samples."""
    return _samples_to_rest(closed_loop_poles(law, linear))


def slowest_lag(law: Law, linear: Linear) -> float:
    """Return the time constant of the slowest mode of the linearized loop, s."""
    return _slowest_lag(closed_loop_poles(law, linear)) * law.period


def _samples_to_rest(poles: Response) -> int:
    return max(200, int(LAGS * _slowest_lag(poles)))


def _slowest_lag(poles: Response) -> float:
    return 1 / -math.log(min(max(float(np.max(np.abs(poles))), 1e-6), SLOWEST))


def closed_loop(law: Law, linear: Linear, reference: Array, optimum: QuadraticSolver | None = None) -> Trajectory:
    """Run the law, limits included, with the plant from rest; `reference` (n,) holds one value a sample.

    `optimum` solves for a law that searches, and is needed by no other.
    """
    return disturbed_loop(law, linear, reference, np.zeros(len(reference)), optimum)


def disturbed_loop(
    law: Law, linear: Linear, reference: Array, load: Array, optimum: QuadraticSolver | None = None
) -> Trajectory:
    """Run the law as `closed_loop` does, with `load` (n,) added to its output where that enters the plant."""
    at_reference, _ = reference_and_measurement(law.inputs)
    sampled = zero_order_hold(linear, law.period)
    wires, _, _ = _measured(law, sampled)
    a, b, c = (ca.sparsify(ca.DM(part)) for part in state_space(sampled))
    seen = ca.sparsify(ca.DM(_seen(law, state_space(sampled)[2])))
    plant, x, r, d = ca.SX.sym("plant", a.shape[0]), ca.SX.sym("x", len(law.state)), ca.SX.sym("r"), ca.SX.sym("d")
    z = ca.SX(list(law.rest) or [min(max(0.0, wire.low), wire.high) for wire in law.inputs])
    z[at_reference] = r
    z[wires] = seen @ plant
    moves = ca.SX.sym("moves", 0 if law.solve is None else law.solve.problem.results + 2)
    x_next, u, flags, _ = law.last.function(x, z, *([] if law.solve is None else [moves]))
    step = ca.Function(
        "step",
        [ca.vertcat(plant, x), ca.vertcat(r, d), moves],
        [ca.vertcat(a @ plant + b[:, 0] * (u[0] + d), x_next), ca.vertcat((c @ plant)[0], u[0], ca.sum1(flags))],
    )
    steps = len(reference)
    start = np.concatenate([np.zeros(a.shape[0]), law.start])
    told = np.array([reference, load], dtype=np.float64)
    if law.solve is None:
        rows = _plain_run(step, start, told)
    else:
        parameters = ca.Function("parameters", [ca.vertcat(plant, x), r], [law.solve.function(x, z)])
        assert optimum is not None, "a law that solves is run with what solves it"
        rows = _solved_run(solver(law.solve, optimum), parameters, step, start, told)
    measured, output, flagged = np.array(rows, dtype=np.float64)
    time = np.arange(steps, dtype=np.float64) * law.period
    return Trajectory(time, np.asarray(reference, dtype=np.float64), measured, output, flagged > 0)


def _plain_run(step: ca.Function, start: Array, told: Array) -> Array:
    """Run `step` without moves; `told`: reference and load, a column a sample."""
    steps = told.shape[1]
    block = step.mapaccum(min(steps, BLOCK))
    size = block.size2_in(1)
    state, results = start, []
    for first in range(0, steps, size):
        part = told[:, first : first + size]
        whole = np.pad(part, ((0, 0), (0, size - part.shape[1])))
        states, rows = block(state, whole, np.zeros((0, size)))
        state = np.array(states)[:, -1]
        results.append(np.array(rows)[:, : part.shape[1]])
    return np.hstack(results)


def _solved_run(
    find: Callable[[Array], Solution], parameters: ca.Function, step: ca.Function, start: Array, told: Array
) -> Array:
    """Run `step` with the moves that `find` returns at `parameters`; `told`: reference and load, a column a sample."""
    state, results = start, []
    for outside in told.T:
        found = find(np.array(parameters(state, outside[0])).T)
        moves = [*found.moves[0], found.status[0] == CAPPED, found.status[0] == INFEASIBLE]
        after, row = step(state, outside, np.array(moves, dtype=np.float64))
        state = np.array(after).ravel()
        results.append(np.array(row).ravel())
    return np.array(results).T


def noise_gain(law: Law, linear: Linear) -> float:
    """Rms of the output over the rms of white noise on the measurement, in the stable linearized loop (its H2 norm)."""
    linearized, sampled = _both(law, linear)
    wires, _, _ = _measured(law, sampled)
    ring, a_size = _ring(law, linearized, sampled), len(state_space(sampled)[0])
    b_law, d_law = linearized.b[:, wires[:1]], linearized.d[:1, wires[:1]]
    b = np.vstack([state_space(sampled)[1][:, :1] @ d_law, b_law])
    c = np.hstack([linearized.d[:1, wires] @ _seen(law, state_space(sampled)[2]), linearized.c[:1]])
    assert b.shape[0] == len(ring) == a_size + len(linearized.a)
    spread = scipy.linalg.solve_discrete_lyapunov(ring, b @ b.T)
    return math.sqrt(max(float((c @ spread @ c.T + d_law @ d_law.T)[0, 0]), 0.0))


def _both(law: Law, linear: Linear) -> tuple[LinearLaw, Sampled]:
    """Return the linearized law and the sampled plant, the latter made first.

    A delay that is far too long leaves a tuned law nothing to act with, and is what has to be told.
    """
    sampled = zero_order_hold(linear, law.period)
    return linearize_law(law), sampled


def _response(law: Law, linearized: LinearLaw, sampled: Sampled) -> Callable[[Array], Response]:
    """Return w (n,) -> L(exp(j w h)) (n,)."""
    wires, c, d = _measured(law, sampled)
    b_law, d_law = linearized.b[:, wires], linearized.d[0, wires]

    def response(frequency: Array) -> Response:
        z = np.exp(1j * frequency * law.period)
        inputs = sampled.b_now[:, 0] + sampled.b_before[:, 0] / z[:, None]
        loop = np.zeros(len(z), dtype=np.complex128)
        for k in range(len(wires)):
            plant = _transfer(sampled.a, inputs, c[k], z) + d[k] / z
            drive = np.broadcast_to(b_law[:, k], (len(z), len(b_law)))
            loop -= (_transfer(linearized.a, drive, linearized.c[0], z) + d_law[k]) * plant
        return np.asarray(loop * z ** (-sampled.whole), dtype=np.complex128)

    return response


def _measured(law: Law, sampled: Sampled) -> tuple[list[int], Array, Array]:
    """Find the inputs of the law that the plant drives, and the plant's c (inputs, n) and d (inputs,) for them."""
    if not law.states:
        wires = list(law.watched) or [reference_and_measurement(law.inputs)[1]]
        rows = _rows(law)
        return wires, sampled.c[rows], sampled.d[rows, 0]
    own = len(law.states)
    return list(law.states), np.eye(own, len(sampled.a)), np.zeros(own)


def _seen(law: Law, c: Array) -> Array:
    """Return what the law measures of the plant's state and past inputs."""
    return np.eye(len(law.states), c.shape[1]) if law.states else c[_rows(law)]


def _rows(law: Law) -> list[int]:
    """Return which outputs of the plant the law measures, y or those that it watches."""
    return list(law.watched_outputs) or list(range(max(1, len(law.watched))))


def _transfer(a: Array, b: Array | Response, c: Array, z: Response) -> Response:
    """C (z I - A)^-1 b for every z (n,); b (n, order)."""
    if not len(a):
        return np.zeros(len(z), dtype=np.complex128)
    solved = np.linalg.solve(z[:, None, None] * np.eye(len(a)) - a, b[:, :, None])
    return np.asarray(solved[:, :, 0] @ c, dtype=np.complex128)


def _ring(law: Law, linearized: LinearLaw, sampled: Sampled) -> Array:
    """Return the matrix that takes the states of plant and law to the next sample."""
    wires, _, _ = _measured(law, sampled)
    a, b, c = state_space(sampled)
    b, c = b[:, :1], _seen(law, c)
    b_law, c_law = linearized.b[:, wires], linearized.c[:1]
    return np.block([[a + b @ linearized.d[:1, wires] @ c, b @ c_law], [b_law @ c, linearized.a]])


def _grid(poles: Response, period: float, whole: int) -> Array:
    """Frequencies (n,) from far below the slowest pole to Nyquist's, dense where a pole rings."""
    top = math.pi / period
    logs = np.log(poles[np.abs(poles) > 1e-9]) / period
    speeds = np.abs(logs)[np.abs(logs) > 1e-9 * top]
    bottom = 1e-3 * min(speeds.min(initial=top), top)
    spread = np.concatenate([-np.geomspace(20, 1e-3, 100), [0.0], np.geomspace(1e-3, 20, 100)])
    ringing = [abs(p.imag) + abs(p.real) * spread for p in logs if 0 < abs(p.real) < abs(p.imag)]
    grid = np.concatenate([np.geomspace(bottom, top, 6000), np.linspace(bottom, top, 2000 + 40 * whole), *ringing])
    return np.unique(grid[(grid >= bottom) & (grid <= top)])


def _phase_crossings(response: Callable[[Array], Response], grid: Array, loop: Response) -> list[float]:
    """Frequencies at which L is real and negative, Nyquist's frequency included."""
    inside = _roots(lambda w: response(np.array([w]))[0].imag, grid[:-1], loop[:-1].imag)
    found = [w for w in inside if response(np.array([w]))[0].real < 0]
    return [*found, float(grid[-1])] if loop[-1].real < 0 else found


def _roots(function: Callable[[float], float], grid: Array, values: Array) -> list[float]:
    """Roots of `function`, one for each change of sign of its `values` on the grid."""
    changes = np.flatnonzero(np.sign(values[:-1]) * np.sign(values[1:]) < 0)
    return [float(scipy.optimize.brentq(function, grid[k], grid[k + 1], xtol=1e-12 * grid[k])) for k in changes]


def _sensitivity_peak(response: Callable[[Array], Response], grid: Array, loop: Response) -> float:
    """Find max |1/(1 + L)|, refined around the highest point of the grid."""
    distance = np.abs(1 + loop)
    k = int(np.argmin(distance))
    low, high = grid[max(k - 1, 0)], grid[min(k + 1, len(grid) - 1)]
    refined = scipy.optimize.minimize_scalar(
        lambda w: abs(1 + response(np.array([w]))[0]), bounds=(low, high), method="bounded"
    )
    return float(1 / min(distance[k], refined.fun))


def _decibel(factor: float) -> float:
    """20 log10, with both ends of the scale."""
    return -math.inf if factor == 0 else 20 * math.log10(factor) if math.isfinite(factor) else factor
