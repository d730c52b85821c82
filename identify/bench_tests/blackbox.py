r"""Fit a linear model where no physics is known: ARX, output error, or a subspace method.

- ARX: y[k] + a1 y[k-1] + ... = b1 u[k-d] + ... + e[k], one linear least-squares problem (L. Ljung, System
  Identification, 1999, section 4.2). Noise that is not white through 1/A, as a sensor's is not, pulls it towards faster
  poles; then it is solved with instruments: past outputs that a model simulates, free of noise, all signals filtered
  by its denominator (P. Young and A. Jakeman, Int. J. Control 29 (1979) 1-30).
- OE: the same polynomials, but the simulated output comes closest (section 4.2, eq. 4.25), by Gauss-Newton from several
  ARX fits; every recording has its own start.
- n4sid: a state space from projections of past and future data (P. Van Overschee and B. De Moor, Automatica 30 (1994)
  75-93), by the library nfoursid; the longest recording alone.

The sampled model is turned into a continuous one by the logarithm of its matrix, exactly where the input is held.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from firmloop.identify.bench_tests.richness import richness
from firmloop.identify.error import IdentifyError
from firmloop.identify.extras import extra
from firmloop.identify.fitting.least_squares import fit_function

Array = NDArray[np.float64]

EVALUATIONS = 60  # of the simulation error
PER_UNKNOWN = 10  # rows that a model needs for each of its coefficients
ROUNDS = 6  # of filtering by the last denominator
PULLED = 1.03  # times the mean square error of another model: more is no chance
CERTAIN = 0.999  # probability with which noise would not let itself be explained so far
INTEGRATES = 0.1  # of a recording: a pole that decays or grows by less over it is one that integrates
ROUNDED = 1e-12  # beyond the unit circle: no more than rounding
EVEN = 1e-3  # share of a period by which samples may be early or late


@dataclass(frozen=True, slots=True)
class Record:
    """One recording of one input and one output, evenly sampled: arrays (n,)."""

    source: str
    drive: Array
    output: Array


@dataclass(frozen=True, slots=True)
class SampledModel:
    """x[k+1] = a x[k] + b u[k - late], y[k] = c x[k]."""

    a: Array  # (n, n)
    b: Array  # (n,)
    c: Array  # (n,)
    late: int  # samples


@dataclass(frozen=True, slots=True)
class Continuous:
    """dx/dt = a x + b u(t - delay), y = c x."""

    a: Array
    b: Array
    c: Array
    delay: float  # s


def fit_arx(records: Sequence[Record], order: int, late: int) -> SampledModel:
    """Least squares; with instruments where these simulate better by more than chance, as with a sensor's noise."""
    plain, (near, _) = least_squares_arx(records, order, late), prefiltered(records, order, late)
    passed = _passed(near, records)
    rows = _rows([record.output for record in passed], passed, order, late)
    shown = _passed(near, [Record(one.source, one.drive, _simulated(near, one)) for one in records])
    instruments = _rows([record.output for record in shown], shown, order, late)
    found = np.linalg.lstsq(instruments.T @ rows, instruments.T @ _aim(passed, order, late), rcond=None)[0]
    model = _companion(found[:order], found[order:], late)
    return model if miss(plain, records) > PULLED * miss(model, records) else plain


def least_squares_arx(records: Sequence[Record], order: int, late: int) -> SampledModel:
    """Least squares for a1..an, b1..bn with b1 on u[k - 1 - late]."""
    rows = _rows([record.output for record in records], records, order, late)
    found = np.linalg.lstsq(rows, _aim(records, order, late), rcond=None)[0]
    return _companion(found[:order], found[order:], late)


def _rows(outputs: Sequence[Array], records: Sequence[Record], order: int, late: int) -> Array:
    """Return what a1..an, b1..bn stand before: past values of `outputs` and of every recording's input."""
    first, ages = order + late, range(1, order + 1)
    return np.concatenate(
        [
            np.column_stack(
                [-output[first - k : len(output) - k] for k in ages]
                + [record.drive[first - late - k : len(output) - late - k] for k in ages]
            )
            for output, record in zip(outputs, records, strict=True)
        ]
    )


def _aim(records: Sequence[Record], order: int, late: int) -> Array:
    return np.concatenate([record.output[order + late :] for record in records])


def _passed(model: SampledModel, records: Sequence[Record]) -> list[Record]:
    """Filter both signals by the model's denominator."""
    below = np.concatenate([[1.0], -model.a[:, 0]])
    return [Record(one.source, *scipy.signal.lfilter([1.0], below, [one.drive, one.output])) for one in records]


def prefiltered(records: Sequence[Record], order: int, late: int) -> tuple[SampledModel, float]:
    """Least squares on signals filtered by the last denominator, which comes near to output error in a few steps.

    K. Steiglitz and L. E. McBride, IEEE Trans. AC 10 (1965) 461-464; the model that simulates best is returned, and
    what it misses.
    """
    best, least = steadied(least_squares_arx(records, order, late), records)
    model = best
    for _ in range(ROUNDS):
        passed = _passed(model, records)
        if not all(np.all(np.isfinite(part)) for one in passed for part in (one.drive, one.output)):
            break
        model, left = steadied(least_squares_arx(passed, order, late), records)
        best, least = (model, left) if left < least else (best, least)
    return best, least


def fit_oe(records: Sequence[Record], order: int, late: int) -> SampledModel:
    """Least squares of the simulation error; the start is the best of ARX fits to ever smoother data."""
    starts = [least_squares_arx(records, order, late)]
    for width in (5, 15, 45):
        smooth = [
            Record(r.source, *(scipy.signal.filtfilt(np.ones(width) / width, [1.0], s) for s in (r.drive, r.output)))
            for r in records
            if len(r.output) > 6 * width
        ]
        if len(smooth) == len(records):
            starts.append(least_squares_arx(smooth, order, late))
    begin, _ = min((steadied(start, records) for start in starts), key=lambda each: each[1])
    below, above = -begin.a[:, 0], begin.b
    start = np.concatenate([below, above])
    scale = np.maximum(np.abs(start), 1e-3 * np.abs(above).max())

    def residual(values: Array) -> Array:
        model = _companion(values[:order], values[order:], late)
        left = np.clip(np.concatenate(residuals(model, records)), -1e12, 1e12)
        left[np.isnan(left)] = 1e12
        return left

    values, _ = fit_function(residual, start, scale, np.full(len(start), -np.inf), EVALUATIONS)
    return _companion(values[:order], values[order:], late)


def fit_n4sid(records: Sequence[Record], order: int, late: int) -> SampledModel:
    """Hand the longest recording to nfoursid; its direct way from u[k] to y[k] is left out, for nothing is so fast."""
    record = max(records, key=lambda one: len(one.output))
    drive = np.concatenate([np.zeros(late), record.drive[: len(record.drive) - late]])
    pandas, nfoursid = (extra(name, "blackbox", "structure = 'n4sid'") for name in ("pandas", "nfoursid.nfoursid"))
    frame = pandas.DataFrame({"u": drive, "y": record.output})
    logging.getLogger("nfoursid").setLevel(logging.ERROR)
    method = nfoursid.NFourSID(frame, output_columns=["y"], input_columns=["u"], num_block_rows=max(10, 2 * order))
    method.subspace_identification()
    space, _ = method.system_identification(rank=order)
    model = SampledModel(np.asarray(space.a), np.asarray(space.b)[:, 0], np.asarray(space.c)[0], late)
    return model


STRUCTURES: Mapping[str, Callable[[Sequence[Record], int, int], SampledModel]] = {
    "arx": fit_arx,
    "oe": fit_oe,
    "n4sid": fit_n4sid,
}


def redrawn(structure: str, records: Sequence[Record], model: SampledModel, draws: int) -> list[SampledModel]:
    """Fit again, `draws` times, what the model says with its residuals drawn anew (B. Efron, Ann. Stat. 7 (1979) 1-26).

    That is right where the residuals are white, which the caller has to test.
    """
    plain = companion(model)
    shown = [_simulated(plain, record) for record in records]
    left = [record.output - made for record, made in zip(records, shown, strict=True)]
    random = np.random.default_rng(1)
    return [
        STRUCTURES[structure](
            [
                Record(record.source, record.drive, made + random.choice(rest - rest.mean(), len(rest)))
                for record, made, rest in zip(records, shown, left, strict=True)
            ],
            len(model.a),
            model.late,
        )
        for _ in range(draws)
    ]


def check_records(records: Sequence[Record], order: int, late: int) -> None:
    """Refuse recordings that are too short for the model, or whose input says too little."""
    rows, unknowns = sum(len(record.output) for record in records), 2 * order
    if rows < PER_UNKNOWN * unknowns + late + order:
        raise IdentifyError(
            f"{records[0].source}: {rows} rows are too few for a model of order {order}: its {unknowns} coefficients "
            f"need at least {PER_UNKNOWN * unknowns + late + order}; record longer, or ask for a lower order"
        )
    excited = richness([record.drive for record in records], unknowns)
    if excited < unknowns:
        lower = f", or set model.order = {excited // 2}, which is all that it supports" if excited > 1 else ""
        raise IdentifyError(
            f"{records[0].source}: the input excites {excited} directions (its mean is one, every sine in it two), and "
            f"a model of order {order} has {unknowns} coefficients; play a richer signal, such as one of `firmloop "
            f"excite`{lower}"
        )
    for record in records:
        if np.ptp(record.output) == 0.0:
            raise IdentifyError(f"{record.source}: the output never changes; record the plant while it moves")


def check_answer(structure: str, records: Sequence[Record], model: SampledModel, tried: int) -> None:
    """Refuse a model that explains no more than it would of white noise, the best of `tried` delays taken.

    Off white noise, least squares take as many times its variance as the model has coefficients, and one for its start
    (chi-squared); the best of several delays has as many chances.
    """
    order, rows = len(model.a), sum(len(record.output) for record in records)
    enough = float(scipy.special.chdtri(2 * order + 1, (1.0 - CERTAIN) / tried)) / rows
    explained = _explained(companion(model), records)
    if explained > enough:
        return
    possible = _explained(fit_oe(records, order, model.late), records)
    if possible > enough:
        raise IdentifyError(
            f"{records[0].source}: simulated from the input alone, {structure} explains "
            f"{max(100.0 * explained, 0.0):.2g} % of the output, where output error explains {100.0 * possible:.2g} %; "
            "take structure = 'oe'"
        )
    raise IdentifyError(
        f"{records[0].source}: the output does not answer the input: a model of order {order} explains "
        f"{max(100.0 * max(explained, possible), 0.0):.2g} % of it, no more than of noise; check the wiring, or excite "
        "the plant"
    )


def _explained(model: SampledModel, records: Sequence[Record]) -> float:
    """Return the share of the output's variance that a simulation explains."""
    left = [np.var(np.clip(record.output - _simulated(model, record), -1e12, 1e12)) for record in records]
    return 1.0 - float(np.sum(left) / np.sum([np.var(record.output) for record in records]))


def companion(model: SampledModel) -> SampledModel:
    """Return the model in the form in which it is simulated here."""
    above, below = scipy.signal.ss2tf(model.a, model.b[:, None], model.c[None, :], np.zeros((1, 1)))
    return _companion(below[1:], above[0][1:], model.late)


def unstable(model: SampledModel) -> bool:
    """Tell whether a pole lies outside of the unit circle."""
    return bool(np.max(np.abs(np.linalg.eigvals(model.a))) >= 1.0 + ROUNDED)


def continuous(model: SampledModel, period: float) -> Continuous:
    """Undo the hold: log of [[a, b], [0, 1]] over the period (s).

    Raises
    ------
    IdentifyError
        when a pole is unstable, or negative or zero: no continuous model of this order has it.
    """
    poles = np.linalg.eigvals(model.a)
    if unstable(model):
        raise IdentifyError(
            f"model: the fit is unstable (a pole at {_size(np.max(np.abs(poles)))} in z); where the plant is, record "
            "it in a closed loop and fit a plant with physics; otherwise take a drift of the output out with "
            "recordings.conditioning.detrend, or try another structure or a lower order"
        )
    bad = without_a_form(model)
    if bad:
        raise IdentifyError(
            f"model: the fit has a pole at {bad[0]:.3g} in z, which no continuous plant of this order has; the "
            "order is too high for these recordings, the sampling too slow, or the noise the sensor's (then "
            "structure = 'oe')"
        )
    order = len(model.a)
    block = np.zeros((order + 1, order + 1))
    block[:order, :order], block[:order, order], block[order, order] = model.a, model.b, 1.0
    logarithm = np.real(scipy.linalg.logm(block)) / period
    return Continuous(logarithm[:order, :order], logarithm[:order, order], model.c, model.late * period)


def without_a_form(model: SampledModel) -> list[float]:
    """Return the poles of a stable model that no continuous one of its order has: negative ones, and 0."""
    if unstable(model):
        return []
    return [float(pole.real) for pole in np.linalg.eigvals(model.a) if abs(pole.imag) < 1e-9 and pole.real <= 1e-6]


def missed(model: SampledModel, records: Sequence[Record]) -> float:
    """Return the sum of squares that a simulation misses."""
    return float(sum(np.sum((record.output - _simulated(model, record)) ** 2) for record in records))


def _size(beyond: float) -> str:
    """Print the size of a pole outside the unit circle so that it is seen to be there."""
    return f"{beyond:.4g}" if beyond >= 1.001 else f"1 + {beyond - 1.0:.2g}"


def _companion(below: NDArray[np.floating], above: NDArray[np.floating], late: int) -> SampledModel:
    """Observer form of (b1 z^-1 + ...)/(1 + a1 z^-1 + ...)."""
    order = len(below)
    a = np.zeros((order, order))
    a[:, 0] = -below
    a[: order - 1, 1:] = np.eye(order - 1)
    return SampledModel(a, np.asarray(above, dtype=np.float64), np.eye(order)[0], late)


def steadied(model: SampledModel, records: Sequence[Record]) -> tuple[SampledModel, float]:
    """Pull poles that are unstable to where they would just be stable; return that model and what it misses.

    A simulation can start from it. A plant that integrates would be pulled too far by 0.001; of it and of the rows' own
    measure the better one stays.
    """
    poles = np.linalg.eigvals(model.a)
    size = np.abs(poles)
    if np.all(size < 0.9999):
        return model, miss(model, records)
    most = (0.999, 1.0 - INTEGRATES / max(len(one.output) for one in records))
    ways = [_companion(np.real(np.poly(_pulled(poles, far)))[1:], model.b, model.late) for far in most]
    return min(((each, miss(each, records)) for each in ways), key=lambda pair: pair[1])


def _pulled(poles: NDArray[np.inexact], most: float) -> NDArray[np.inexact]:
    size = np.abs(poles)
    return np.asarray(np.where(size >= 0.9999, poles / np.maximum(size, 1e-12) * most, poles))


def integrating(model: SampledModel, records: Sequence[Record]) -> SampledModel:
    """Put a real pole on 1 where no recording is long enough to tell it from there."""
    poles, turned = np.linalg.eig(model.a)
    near = INTEGRATES / max(len(one.output) for one in records)
    slow = (np.abs(poles - 1.0) < near) & (np.abs(poles.imag) < 1e-12)
    if np.sum(slow) != 1:  # two of them have no eigenvectors of their own
        return model
    a = np.real(turned @ np.diag(np.where(slow, 1.0, poles)) @ np.linalg.inv(turned))
    return SampledModel(a, model.b, model.c, model.late)


def _simulated(model: SampledModel, record: Record) -> Array:
    """Simulate from the initial state that fits best, which is linear in it."""
    below = np.concatenate([[1.0], -model.a[:, 0]])
    forced = scipy.signal.lfilter(model.b, below, _later(record.drive, 1 + model.late))
    rows = len(record.output)
    free = np.zeros((rows, len(model.b)))
    free[0, 0] = 1.0
    free[:, 0] = scipy.signal.lfilter([1.0], below, free[:, 0])
    for k in range(1, len(model.b)):
        free[k:, k] = free[: rows - k, 0]
    with np.errstate(all="ignore"):
        if not np.all(np.isfinite(free)) or np.abs(free).max() > 1e9 or not np.all(np.isfinite(forced)):
            return np.full(rows, np.inf)
        start = np.linalg.lstsq(free, record.output - forced, rcond=1e-12)[0]
    return np.asarray(forced + free @ start)


def _later(signal: Array, rows: int) -> Array:
    return np.concatenate([np.zeros(rows), signal])[: len(signal)]


def residuals(model: SampledModel, records: Sequence[Record]) -> list[Array]:
    """Return what a simulation leaves of every recording."""
    return [one.output - _simulated(model, one) for one in records]


def miss(model: SampledModel, records: Sequence[Record]) -> float:
    """Return the mean square error of a simulation, the mean over recordings."""
    parts = [np.mean(np.minimum((r.output - _simulated(model, r)) ** 2, 1e24)) for r in records]
    return float(np.mean(parts))
