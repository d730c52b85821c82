"""Fit a linear model to data alone, and write it as equations that every other verb takes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np
import scipy

from firmloop.identify.bench_tests.blackbox import (
    CERTAIN,
    EVEN,
    STRUCTURES,
    Continuous,
    Record,
    SampledModel,
    check_answer,
    check_records,
    companion,
    continuous,
    integrating,
    missed,
    redrawn,
    unstable,
    without_a_form,
)
from firmloop.identify.bench_tests.delay_search import (
    DelaysAlike,
    best_delays,
    delays_tried,
    rest_of_an_integrator,
    spoiled_by_lines,
    spoiled_by_means,
    spoiled_by_rest,
    without_means,
)
from firmloop.identify.error import IdentifyError
from firmloop.identify.fitting.own_values import fit_start
from firmloop.identify.fitting.residual_tests import residual_tests
from firmloop.identify.fitting.scores import scores
from firmloop.identify.plants.plant_table import plant_from_table
from firmloop.identify.recordings.clock import evened
from firmloop.identify.recordings.conditioning import NONE, condition_input, condition_output
from firmloop.identify.recordings.recording import Recording, column
from firmloop.identify.simulation.simulate import constants_of, simulate
from firmloop.project.project import Project, require
from firmloop.project.table import ProjectTable
from firmloop.stages.bench.model_notes import (
    WHITE,
    about_drift,
    about_lead,
    about_line,
    about_noise,
    about_order,
    about_rest,
    found_delay,
    given_delay,
)
from firmloop.stages.data import conditioning_of, read_data
from firmloop.stages.plant import located
from firmloop.stages.progress import Stage
from firmloop.stages.saturation import cut_input, refuse_saturated

MOST_ORDER = 12
DRAWS = 40  # of the model with its own residuals, for intervals
_NO_POLE = 1e-9  # of the fastest pole: rounding of one at 0
_NO_FORM = "a model of order {} has no continuous form"


def _whole(part: ProjectTable, key: str, default: int, low: int, high: int) -> int:
    value = part.values.get(key, default)
    if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
        raise part.wrong(key, f"must be a whole number from {low} to {high}")
    return value


def _period(recordings: Sequence[Recording]) -> float:
    """Return the one sampling time of all recordings, s."""
    steps = [np.diff(evened(recording.time)) for recording in recordings]
    period = float(np.median(steps[0]))
    for recording, step in zip(recordings, steps, strict=True):
        if recording.hold != "zero_order":
            raise IdentifyError(
                f"recordings.hold is {recording.hold!r}; a black-box model takes its input as held between rows: leave "
                "it out, or fit a plant with physics"
            )
        if np.abs(step - period).max() > EVEN * period + 1e-12:
            raise IdentifyError(
                f"{recording.source}: rows are {step.min():g} to {step.max():g} s apart, and a black-box model needs "
                f"one distance, here {period:g} s; resample the file, or fit a plant with physics, which takes it as "
                "it is"
            )
    return period


def _record(project: Project, recording: Recording) -> Record:
    assert project.plant is not None
    conditioning, drive, output = conditioning_of(project), project.plant.input, project.plant.outputs[0]
    u = condition_input(conditioning, drive, column(recording, drive))
    return Record(recording.source, u, _compared(project, recording, column(recording, output)))


def _compared(project: Project, recording: Recording, values: np.ndarray) -> np.ndarray:
    """Condition the output, measured or simulated, where it keeps its rows."""
    assert project.plant is not None
    conditioning = conditioning_of(project)
    if conditioning == NONE or conditioning.resample_s:
        return values
    return condition_output(conditioning, project.plant.outputs[0], recording.time, values)


def _ode(project: Project, made: Continuous) -> Mapping[str, object]:
    """Write the model as an `ode` plant of the contract; its whole samples of delay are an effect."""
    assert project.plant is not None
    drive, output = project.plant.input, project.plant.outputs[0]
    states = [f"x{k}" for k in range(1, len(made.a) + 1)]
    derivatives = {name: _sum([*made.a[k], made.b[k]], [*states, drive]) for k, name in enumerate(states)}
    plant: dict[str, object] = {
        "kind": "ode",
        "states": states,
        "inputs": [drive],
        "outputs": {output: _sum(made.c, states)},
        "derivatives": derivatives,
    }
    if made.delay > 0.0:
        plant["effects"] = [{"name": "input_delay", "delay_s": made.delay}]
    return plant


def _sum(factors: Sequence[float] | np.ndarray, names: Sequence[str]) -> str:
    words = [f"({float(factor)!r})*{name}" for factor, name in zip(factors, names, strict=True) if factor != 0.0]
    return " + ".join(words) or "0.0"


def _judge(project: Project, table_of_plant: Mapping[str, object], recording: Recording) -> Mapping[str, object]:
    """Simulate a recording from the start that fits best; score the whole of it and test what is left."""
    plant, record = plant_from_table(table_of_plant), _record(project, recording)
    assert project.plant is not None
    driven = replace(recording, columns=MappingProxyType({**recording.columns, project.plant.input: record.drive}))
    start = fit_start(plant, driven, constants_of(plant), conditioning_of(project))
    simulated = _compared(project, recording, simulate(plant, driven, start)[:, 0])
    found, tests = scores(record.output, simulated), residual_tests(record.output - simulated, record.drive)
    return {
        "recording": recording.source,
        "fit_percent": found.fit_percent,
        "rmse": found.rmse,
        "r2": found.r2,
        "whiteness": tests.whiteness,
        "independence": tests.independence,
    }


def _spread(
    structure: str,
    records: Sequence[Record],
    sampled: SampledModel,
    period: float,
    judged: Sequence[Mapping[str, object]],
) -> Mapping[str, object] | None:
    """Return half widths of the 95 % intervals of gain and poles; None where the residuals do not allow any.

    Nor are there any by n4sid: it takes seconds a draw.
    """
    if structure == "n4sid" or not white(judged):
        return None
    try:
        again = redrawn(structure, records, sampled, DRAWS)
        drawn = [continuous(integrating(one, records), period) for one in again]
    except IdentifyError:  # some draw has no continuous model: neither has its spread a meaning
        return None
    integrates = any(np.isinf(gain_at_rest(one)) for one in drawn)
    factor = float(scipy.special.stdtrit(DRAWS - 1, 0.975))
    poles = np.array([poles_of(one) for one in drawn])
    return {
        "gain": None if integrates else factor * float(np.std([gain_at_rest(one) for one in drawn], ddof=1)),
        "poles_rad_s": [
            [factor * float(np.std(part, ddof=1)) for part in (column.real, column.imag)] for column in poles.T
        ],
    }


def white(judged: Sequence[Mapping[str, object]]) -> bool:
    """Tell whether every recording's residuals are white."""
    return all(isinstance(one["whiteness"], float) and one["whiteness"] >= WHITE for one in judged)


def poles_of(made: Continuous) -> np.ndarray:
    """Return the poles (n,) in rad/s, in one order for models alike."""
    poles = np.linalg.eigvals(made.a).astype(np.complex128)
    poles[np.abs(poles) <= _NO_POLE * max(float(np.abs(poles).max()), float(np.linalg.norm(made.a)))] = 0.0
    return np.sort_complex(poles)


def gain_at_rest(made: Continuous) -> float:
    """Return output per input at rest; infinite with an integrator."""
    if np.any(poles_of(made) == 0.0):
        return float("inf")
    return float(-made.c @ np.linalg.solve(made.a, made.b))


@dataclass(frozen=True, slots=True)
class BlackBox:
    """A model from data alone: sampled, continuous and as a [plant] table; how it does on each recording."""

    structure: str
    period: float  # s
    sampled: SampledModel
    made: Continuous
    delays: DelaysAlike
    plant: Mapping[str, object]
    judged: Mapping[str, Sequence[Mapping[str, object]]]  # by role
    spread: Mapping[str, object] | None  # half widths of 95 % intervals
    cut: str  # says where the input runs into a limit
    notes: tuple[str, ...]  # how the files were read, where they are not plain; on the delay and the noise


def black_box(project: Project, stage: Stage) -> BlackBox:
    """Fit `[model]` to the train recordings.

    Raises
    ------
    ProjectError
        when a key is wrong, or the recordings do not hold such a model.
    """
    require(project, "plant", "recordings")
    assert project.plant is not None
    asked = project.document.table("model")
    asked.only(("structure", "order", "delay_samples"))
    structure = asked.text("structure", 'structure = "oe"') if "structure" in asked.values else "oe"
    if structure not in STRUCTURES:
        raise asked.wrong("structure", f"is no model structure; known: {', '.join(STRUCTURES)}")
    order, told = _whole(asked, "order", 2, 1, MOST_ORDER), _whole(asked, "delay_samples", 0, 0, 10_000)
    searched = "delay_samples" not in asked.values
    data = read_data(project)
    refuse_saturated(project, data.train)
    drive, output = project.plant.input, project.plant.outputs[0]
    with located(project):
        period = _period(data.train)
        records = [_record(project, recording) for recording in data.train]
        check_records(records, order, told)
        with stage(f"fitting {structure}"), _unless_early(records, order, drive, output):
            found = best_delays(records, order)
            late = found.best if searched else told
            _check_means(project, records, order, late)
            sampled = integrating(STRUCTURES[structure](records, order, late), records)
            if unstable(sampled):  # what a plant that integrates begins with is no offset, but spoils the equations
                from_zero = [Record(one.source, one.drive, one.output - one.output[0]) for one in records]
                again = integrating(STRUCTURES[structure](from_zero, order, late), from_zero)
                records, sampled = (records, sampled) if unstable(again) else (from_zero, again)
                if unstable(sampled) and spoiled_by_lines(records, order, late):
                    raise IdentifyError(about_drift(records, drive, output))
            check_answer(structure, records, sampled, delays_tried(records) if searched else 1)
            lower = _lower(structure, records, sampled, searched) if without_a_form(sampled) else None
            if lower is not None and "order" in asked.values:
                raise asked.wrong("order", f"{_NO_FORM.format(order)}; {len(lower.a)} explains no less: write that")
            made = continuous(lower or sampled, period)
            sampled = lower or sampled
        plant = _ode(project, made)
        judged = {
            role: [_judge(project, plant, recording) for recording in recordings]
            for role, recordings in (("train", data.train), ("test", data.test))
        }
        with stage("drawing the residuals anew"):
            spread = _spread(structure, records, sampled, period, judged["train"])
    cut = cut_input(project, data.train)
    plain = companion(sampled)
    turned = about_order(records, order, drive, output)
    early = turned or (about_lead(records, order, drive, output) if found.least == 0 else "")
    about = (
        found_delay(found) if searched else given_delay(records, order, late, found),
        about_noise(structure, records, plain),
        *(about_rest(one, structure) for one in judged["train"] if not early),
        *(() if early else _about_drift(project, records, plain)),
        early,
    )
    fewer = f"order {len(sampled.a)} is taken: {_NO_FORM.format(order)}, and explains no more"
    notes = (*data.notes, *filter(None, about), *((fewer,) if lower is not None else ()))
    return BlackBox(structure, period, sampled, made, found, plant, judged, spread, cut, notes)


@contextmanager
def _unless_early(records: Sequence[Record], order: int, drive: str, output: str) -> Iterator[None]:
    """Name an output before its input, or rows turned around, where no model is found: they look like other faults."""
    try:
        yield
    except IdentifyError:
        for about in (about_order, about_lead):
            if early := about(without_means(records), order, drive, output):
                raise IdentifyError(early) from None
        raise


def _lower(structure: str, records: Sequence[Record], sampled: SampledModel, searched: bool) -> SampledModel | None:
    """Return the model of the highest lower order that has a continuous form and explains no less; None without one."""
    rows, left = sum(len(one.output) for one in records), missed(companion(sampled), records)
    for order in range(len(sampled.a) - 1, 0, -1):
        late = best_delays(records, order).best if searched else sampled.late
        found = integrating(STRUCTURES[structure](records, order, late), records)
        if unstable(found) or without_a_form(found):
            continue
        more = scipy.special.chdtri(2 * (len(sampled.a) - order), 1.0 - CERTAIN)  # by chance, of coefficients more
        return found if missed(companion(found), records) <= left * (1.0 + more / rows) else None
    return None


def _about_drift(project: Project, records: Sequence[Record], plain: SampledModel) -> Sequence[str]:
    """Say that an output drifts that was to keep its line: past what the model leaves, or into the model."""
    assert project.plant is not None
    drive, output = project.plant.input, project.plant.outputs[0]
    if output in conditioning_of(project).detrend:
        return ()
    if left := about_line(records, plain, output):
        return left
    return (about_drift(records, drive, output),) if spoiled_by_lines(records, len(plain.a), plain.late) else ()


def _check_means(project: Project, records: Sequence[Record], order: int, late: int) -> None:
    """Refuse signals that rest away from 0, where the model would be a better one without their means."""
    assert project.plant is not None
    begun, means_spoil = spoiled_by_rest(records, order, late), spoiled_by_means(records, order, late)
    if begun is None and not means_spoil:
        return
    drive, output = project.plant.input, project.plant.outputs[0]
    rest = rest_of_an_integrator(records, order, late) if means_spoil and begun is None else None
    if rest is not None:
        raise IdentifyError(
            f"{records[0].source}: {output} integrates {drive}, and stands still at {drive} = {rest:.6g} in place of "
            f"0; take that off in [recordings.rename], such as {_offset(drive, rest)}; "
            "the mean is another value, and removing it would harm"
        )
    if begun is None and spoiled_by_lines(records, order, late):
        raise IdentifyError(about_drift(records, drive, output))
    if begun is not None:
        lines = [_offset(name, level) for name, level in zip((drive, output), begun, strict=True) if level != 0.0]
        raise IdentifyError(
            f"{records[0].source}: {output} rests at {begun[1]:.6g} where {drive} is {begun[0]:.6g}, and a linear "
            "model from 0 does not hold; take that off in [recordings.rename], with the names of the file on the left: "
            f"{' and '.join(lines)}; the means are other values"
        )
    means = [float(np.mean(np.concatenate([getattr(one, part) for one in records]))) for part in ("drive", "output")]
    raise IdentifyError(
        f"{records[0].source}: {drive} and {output} rest away from 0 (their means are {means[0]:.3g} and "
        f"{means[1]:.3g}), where a linear model from 0 does not hold; take the means off with "
        f'[recordings.conditioning] remove_offset = ["{drive}", "{output}"]'
    )


def _offset(name: str, level: float) -> str:
    """Write the line of a column that loses a level."""
    return f'{name} = {{ name = "{name}", offset = {-level:.6g} }}'
