"""Close the loop of a program's forms and a sampled plant: one exact linear recursion with bounded inputs.

Its vector holds the plant's states, past plant inputs (newest first) and the program's state words, as distances from
rest. Where the plant's entries are intervals, the middle stays in the matrix, and half the width times what it
multiplies comes in as one more input, at the row it enters.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

from firmloop.verify.proofs.claims import Claims, ProofError
from firmloop.verify.proofs.forever.forms import HALF, Condition, ExactForm, NearPoint
from firmloop.verify.proofs.forever.sampled import Rows, SampledPlants
from firmloop.verify.proofs.forever.stated import Interval, Stated

Row = list[Fraction]
MIDDLE = 1 << 80  # the middle of an interval is taken to a part of it; the rest counts as width
REFERENCE = "reference"


@dataclass(frozen=True, slots=True)
class Line:
    """A row over the vector, and factors of the inputs that act at once, by name."""

    vector: Row
    direct: Mapping[str, Fraction]


@dataclass(frozen=True, slots=True)
class Limit:
    """A condition of the program as a line of the loop."""

    says: str
    line: Line
    margin: Fraction
    strict: bool


@dataclass(frozen=True, slots=True)
class Ring:
    """vector[k+1] = matrix vector[k] + sum of columns[name] input[name].

    `fixed` bounds inputs that are known; `by_levels` gives, of the inputs that stand for widths, factors of the bounds
    of |plant states| and |plant inputs|, and what comes on top.
    """

    matrix: list[Row]
    columns: Mapping[str, Row]
    fixed: Mapping[str, Fraction]
    by_levels: Mapping[str, tuple[Row, Fraction]]
    drift: Row  # what is left of the recursion at rest: nothing, but for rounded numbers
    levels: list[Line]
    at_rest: Row  # |plant states|, |plant inputs| at rest
    error: Line
    error_at_rest: Fraction
    limits: list[Limit]


@dataclass(frozen=True, slots=True)
class _Sum:
    """A value of the loop while it is put together: value at rest is `constant` once the vector's is added."""

    constant: Fraction
    vector: Row
    direct: dict[str, Fraction]

    def plus(self, other: _Sum, factor: Fraction) -> _Sum:
        direct = dict(self.direct)
        for name, value in other.direct.items():
            direct[name] = direct.get(name, Fraction(0)) + factor * value
        vector = [a + factor * b if b else a for a, b in zip(self.vector, other.vector, strict=True)]
        return _Sum(self.constant + factor * other.constant, vector, direct)


def close(claims: Claims, stated: Stated, rest: Sequence[Fraction], plant: SampledPlants) -> Ring:
    """Close it around `rest`.

    Raises
    ------
    ProofError
        when the certificate does not fit the program, or the program is not linear at rest.
    """
    return _Closing(claims, stated, rest, plant).ring()


class _Closing:
    def __init__(self, claims: Claims, stated: Stated, rest: Sequence[Fraction], plant: SampledPlants) -> None:
        self.claims, self.stated, self.rest, self.plant = claims, stated, rest, plant
        self.states, self.inputs = len(plant.a), len(stated.drives)
        self.ages = max((*plant.taps, *plant.reads), default=0)
        self.words = [value for value in claims.state if value.name not in {name for name, *_ in claims.parameters}]
        self.size = self.states + self.ages * self.inputs + len(self.words)
        if len(rest) != self.size:
            raise ProofError(f"loop.json: rest has {len(rest)} values; plant, past inputs and program have {self.size}")
        self._check_wires()

    def _check_wires(self) -> None:
        inputs, outputs = {v.name for v in self.claims.inputs}, {v.name for v in self.claims.outputs}
        told = {self.stated.reference} if self.stated.reference is not None else set()
        for name, known in (
            *((n, inputs) for n in (*told, *self.stated.measured)),
            *((n, outputs) for n in self.stated.drives),
        ):
            if name not in known:
                raise ProofError(f"loop.json: the program has no {name!r}")
        if told & set(self.stated.measured) or len(set(self.stated.drives)) != self.inputs:
            raise ProofError("loop.json: a wire of the program is named twice")

    def _unit(self, index: int) -> _Sum:
        return _Sum(Fraction(0), [Fraction(k == index) for k in range(self.size)], {})

    def _still(self, value: Fraction) -> _Sum:
        return _Sum(value, [Fraction(0)] * self.size, {})

    def ring(self) -> Ring:
        stated, rest = self.stated, self.rest
        outputs = [self._output(k) for k in range(len(self.plant.read_x))]
        read = self._read(outputs)
        first_word = self.states + self.ages * self.inputs
        words = {f"self.{value.name}": self._unit(first_word + k) for k, value in enumerate(self.words)}
        words |= {f"self.{name}": self._still(Fraction(start)) for name, _, _, start in self.claims.parameters}
        seen = {**read, **words}
        near = NearPoint(self.claims, {name: self._at_rest(value) for name, value in seen.items()})
        results = dict(zip((v.name for v in self.claims.outputs), self.claims.results, strict=True))
        scales = {v.name: Fraction(1, 1 << v.fraction) for v in self.claims.outputs}
        driven = [self._joined(near.form(results[name]), seen, scales[name]) for name in stated.drives]
        after = [self._after(k, driven) for k in range(self.states)]
        if self.ages:
            after += driven + [self._unit(self.states + k) for k in range((self.ages - 1) * self.inputs)]
        after += [self._joined(near.form(self.claims.following[v.name]), seen, Fraction(1)) for v in self.words]
        limits = [self._limit(one, seen) for one in near.conditions] + self._of_inputs(read)
        drift = [self._at_rest(value) - held for value, held in zip(after, rest, strict=True)]
        followed = self._still(stated.rest_reference)
        if stated.reference is not None:
            followed.direct[REFERENCE] = Fraction(1)
        error = followed.plus(outputs[0], Fraction(-1))
        levels = [self._unit(k) for k in range(self.states)] + driven
        seen_at_once = {name for value in (*levels, error) for name in value.direct}
        seen_at_once |= {name for limit in limits for name in limit.line.direct}
        columns, fixed, by_levels = self._inputs(after, [abs(x) for x in drift], sorted(seen_at_once))
        return Ring(
            matrix=[value.vector for value in after],
            columns=columns,
            fixed=fixed,
            by_levels=by_levels,
            drift=drift,
            levels=[Line(value.vector, value.direct) for value in levels],
            at_rest=[abs(self._at_rest(value)) for value in levels],
            error=Line(error.vector, error.direct),
            error_at_rest=abs(self._at_rest(error)),
            limits=limits,
        )

    # -- the plant -------------------------------------------------------------------------------------------------

    def _past(self, age: int, driven: Sequence[_Sum]) -> list[_Sum]:
        """Return the plant's inputs so many samples ago."""
        if age == 0:
            return list(driven)
        first = self.states + (age - 1) * self.inputs
        return [self._unit(first + k) for k in range(self.inputs)]

    def _weighed(self, rows: Sequence[Interval], values: Sequence[_Sum], total: _Sum) -> _Sum:
        for entry, value in zip(rows, values, strict=True):
            total = total.plus(value, middle(entry))
        return total

    def _output(self, index: int) -> _Sum:
        plant = self.plant
        total = self._weighed(
            plant.read_x[index], [self._unit(k) for k in range(self.states)], self._still(middle(plant.read_c[index]))
        )
        for age, rows in plant.reads.items():
            total = self._weighed(rows[index], self._past(age, ()), total)
        total.direct[f"width of output {index}"] = Fraction(1)
        return total

    def _after(self, index: int, driven: Sequence[_Sum]) -> _Sum:
        plant = self.plant
        total = self._weighed(
            plant.a[index], [self._unit(k) for k in range(self.states)], self._still(middle(plant.c[index]))
        )
        for age, rows in plant.taps.items():
            total = self._weighed(rows[index], self._past(age, driven), total)
        total.direct[f"width of state {index}"] = Fraction(1)
        return total

    def _width(
        self, x: Sequence[Interval], by_age: Mapping[int, Rows], index: int, c: Interval
    ) -> tuple[Row, Fraction]:
        """Return factors of the levels, and what comes on top."""
        inputs = [sum((half(rows[index][k]) for rows in by_age.values()), Fraction(0)) for k in range(self.inputs)]
        return [*(half(entry) for entry in x), *inputs], half(c)

    # -- the program -----------------------------------------------------------------------------------------------

    def _read(self, outputs: Sequence[_Sum]) -> dict[str, _Sum]:
        """Return the inputs of the program in units of their last place."""
        stated, found = self.stated, {}
        for value in self.claims.inputs:
            scale, name = Fraction(1 << value.fraction), f"in.{value.name}"
            if value.name == stated.reference:
                found[name] = self._still(scale * stated.rest_reference)
                found[name].direct[REFERENCE] = scale
            elif value.name in stated.measured:
                found[name] = self._still(Fraction(0)).plus(outputs[stated.measured[value.name]], scale)
                found[name].direct[f"reading of {value.name}"] = Fraction(1)
            else:
                found[name] = self._still(Fraction(0))
        return found

    def _joined(self, form: ExactForm, seen: Mapping[str, _Sum], scale: Fraction) -> _Sum:
        total = self._still(scale * form.constant)
        for name, factor in form.parts.items():
            if name in seen:
                total = total.plus(seen[name], scale * factor)
            else:
                total.direct[name] = total.direct.get(name, Fraction(0)) + scale * factor
        return total

    def _limit(self, condition: Condition, seen: Mapping[str, _Sum]) -> Limit:
        value = self._joined(condition.form, seen, Fraction(1))
        return Limit(condition.says, Line(value.vector, value.direct), condition.margin, condition.strict)

    def _of_inputs(self, read: Mapping[str, _Sum]) -> list[Limit]:
        """Return that what is read stays in its range, beyond which it would be cut."""
        limits = []
        for value in self.claims.inputs:
            one = read[f"in.{value.name}"]
            if value.low is None or value.high is None or not (any(one.vector) or one.direct):
                continue
            rest = self._at_rest(one)
            room = min(rest - Fraction(value.low), Fraction(value.high) - rest)
            limits.append(Limit(f"{value.name} is in its range", Line(one.vector, one.direct), room, strict=False))
        return limits

    # -- the inputs of the loop ------------------------------------------------------------------------------------

    def _at_rest(self, value: _Sum) -> Fraction:
        return value.constant + sum((a * b for a, b in zip(value.vector, self.rest, strict=True) if a), Fraction(0))

    def _inputs(
        self, after: Sequence[_Sum], left: Sequence[Fraction], at_once: Sequence[str]
    ) -> tuple[dict[str, Row], dict[str, Fraction], dict[str, tuple[Row, Fraction]]]:
        columns: dict[str, Row] = {name: [Fraction(0)] * self.size for name in at_once}
        for row, value in enumerate(after):
            for name, factor in value.direct.items():
                columns.setdefault(name, [Fraction(0)] * self.size)[row] += factor
        fixed: dict[str, Fraction] = {}
        by_levels: dict[str, tuple[Row, Fraction]] = {}
        plant = self.plant
        for k in range(len(plant.read_x)):
            by_levels[f"width of output {k}"] = self._width(plant.read_x[k], plant.reads, k, plant.read_c[k])
        for k in range(self.states):
            factors, top = self._width(plant.a[k], plant.taps, k, plant.c[k])
            by_levels[f"width of state {k}"] = factors, top + left[k]
        for name in columns:
            if name != REFERENCE and name not in by_levels:
                fixed[name] = HALF
        # A program's words are whole and rest need not be: it may begin half a unit away, as if that came in each step.
        words = {value.name for value in self.words}
        for row, rest in enumerate(left[self.states :], self.states):
            within = HALF if row >= self.size - len(words) else Fraction(0)
            if rest or within:
                name = f"rest of value {row}"
                columns[name] = [Fraction(k == row) for k in range(self.size)]
                fixed[name] = rest + within
        return columns, fixed, by_levels


def middle(entry: Interval) -> Fraction:
    """Return a short number near the middle of an interval."""
    return Fraction(round((entry[0] + entry[1]) / 2 * MIDDLE), MIDDLE)


def half(entry: Interval) -> Fraction:
    """Return how far an end is from there."""
    return max(abs(entry[0] - middle(entry)), abs(entry[1] - middle(entry)))
