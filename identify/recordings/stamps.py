"""Name the cause of time stamps that do not rise, and a cure that keeps the rows."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from firmloop.identify.error import IdentifyError
from firmloop.identify.printed_units import conversion
from firmloop.identify.recordings.columns import Column, rename_line
from firmloop.identify.recordings.table import RawTable

Array = NDArray[np.float64]

_BITS = (32, 16, 24, 31, 20, 12, 10, 8)
_CALENDAR = {60.0: "a minute", 3600.0: "an hour", 43200.0: "half a day", 86400.0: "a day", 604800.0: "a week"}  # s
_DECIMAL = dict.fromkeys((10.0**power for power in range(10)), "the end of a decimal counter")  # s
_CYCLES = {2.0**32 / (1e6 * f): f"2^32 cycles of a clock of {f} MHz" for f in range(1, 1001)}  # s
# Clocks of microcontrollers, MHz, one for those that are apart by a power of two, which a prescaler divides by; and
# the crystal of clocks, Hz.
_CLOCKS = (1, 3, 5, 7, 9, 11, 13, 15, 21, 25, 27, 33, 35, 45, 75, 85, 125, 133)
_PRESCALED = {
    2.0**power / hertz: f"2^{bits} ticks of {2.0 ** (power - bits) / hertz:.6g} s"
    for hertz in (*(1e6 * f for f in _CLOCKS), 32768.0)
    for power in range(8, 45)
    for bits in (32 if power >= 32 else 24 if power >= 24 else 16,)
}
_SWAPPED = 50  # places that a logger, or a network, puts a row too early or too late
_DOWN = 0.5  # of the steps: a clock that falls more often than it rises counts down
_MIXED = 0.25  # of the steps: half of them fall where rows stand in no order
_SHARE = 0.02  # of the rows: fewer repeated stamps are accidents
_FEWEST = 3  # rows of a recording
_CHANGES = 10  # of a stamp that say enough of the period
_ON_GRID = 1e-3  # of a row: what is left of printed decimals by their binary fractions
_LOOSE = 2.1  # ticks that stamps may be off: rounding at both ends, and a coarser tick after one digit more
_USUAL, _AWAY = 0.95, 4.0  # share of a signal's steps that are usual ones; how many it is away by that has moved
_EVEN = 0.01  # of its step: what rises so evenly is a clock, and no signal with noise
_STRETCH = 20.0  # typical steps a counter may go across its end


def check_stamps(table: RawTable, given: tuple[str, Column], file: str) -> None:
    """Refuse time that does not rise.

    `given` is the name that the time column has in the file, and how the project reads it.

    Raises
    ------
    IdentifyError
        naming the row, the cause and the lines to write into the project.
    """
    time = table.columns[table.names.index("time_s")]
    steps = np.diff(time)
    stuck = np.flatnonzero(steps <= 0.0)
    if not len(stuck):
        return
    k = int(stuck[0])
    where = f"{file}: {table.place} {table.places[k + 1]}, column time_s"
    plain = f"{where}: {float(time[k + 1])!r} does not come after {float(time[k])!r} of the row before"
    if clock := _other_clock(table, stuck):
        raise IdentifyError(
            f"{plain}: time must rise; the column {clock[0]} does, by {clock[1]:.6g} in every row: if that is the "
            f"time, exchange the names time_s and {clock[0]} in the file's header or in [recordings.rename]"
        )
    if in_no_order(time):
        each = float(np.median(np.diff(np.sort(time))))
        raise IdentifyError(
            f"{plain}: time must rise; the rows stand in no order, and sorted by time they go on evenly, {each:.6g} s "
            f"apart: sort the rows of the file by {given[0]}, and keep every one"
        )
    falls = steps[steps < 0.0]
    exchanged = _displaced(time) <= min(_SWAPPED, len(time) // 4)  # rows of a clock that rises
    if len(falls) > _DOWN * len(steps) and steps[0] < 0.0 and not exchanged:  # else a counter seen too seldom, perhaps
        raise _counts_down(time, steps, given, plain, table)
    if len(falls):
        raise _fallen(time, steps, given, plain, table, k)
    if all(np.all(column[stuck] == column[stuck + 1]) for column in table.columns):
        raise IdentifyError(f"{plain}: time must rise; {_copies(stuck)}")
    period = _even_period(time)
    many = len(stuck) > max(2, _SHARE * len(time))
    usual = float(np.median(steps[steps > 0.0])) if np.any(steps > 0.0) else 0.001
    repeat = "repeats" if len(stuck) == 1 else "repeat"
    lost = f"{plain}: the time column has lost digits: {len(stuck)} of {len(time)} stamps {repeat}"
    if period is not None and (many or _leapt_too(time, stuck + 1, usual)):
        each, low, high = period
        unsure = f" ({low:.4g} to {high:.4g} s by the stamps: write the one that was set)" if high > 1.01 * low else ""
        raise IdentifyError(
            f"{lost}, but the rows are even, {each:g} s apart{unsure}. Keep every row and give the period; time_s of "
            "the file is then left aside",
            f"[recordings]\nperiod_s = {each!r}\nstart_s = {float(time[0])!r}",
        )
    if many:
        raise IdentifyError(
            f"{lost} with different readings, and the rows are not even, so that no period gives them back; time must "
            "rise: record it with more digits, or as a counter of microseconds"
        )
    raise IdentifyError(
        f"{plain}: time must rise; the readings of both rows differ, so that "
        f"{_stamps_or_rows(time, stuck + 1, usual, 'correct it')}",
        _period_lines(time, stuck + 1, usual),
    )


def in_no_order(time: Array) -> bool:
    """Tell whether stamps (n,) are those of an even clock whose rows somebody has mixed up.

    A counter that wraps falls by as much each time, and rows that a logger has swapped fall seldom and not far.
    """
    steps, sorted_steps = np.diff(time), np.diff(np.sort(time))
    falls, usual = steps[steps < 0.0], float(np.median(sorted_steps)) if len(steps) else 0.0
    even = usual > 0.0 and float(np.ptp(sorted_steps)) < 0.5 * usual
    return even and len(falls) > _MIXED * len(steps) and float(np.ptp(falls)) > 0.5 * float(np.ptp(time))


def check_wraps(counts: Array, table: RawTable, given: tuple[str, Column], file: str) -> None:
    """Refuse `wraps` of a clock that counts (n,) as the file has them where another number of bits fits all its falls.

    Only where it makes a long leap of every fall: a logger that has paused across one tells nothing.

    Raises
    ------
    IdentifyError
        naming the fall, what `wraps` makes of it, and the line that fits.
    """
    foreign, rule = given
    counted = np.diff(counts) * (1.0 if rule.scale > 0.0 else -1.0)  # of a clock that counts down
    passed = np.diff(table.columns[table.names.index("time_s")])
    fallen, risen = counted < 0.0, counted > 0.0
    if not rule.wraps or not np.any(fallen) or not np.any(risen):
        return
    usual, leaps = float(np.median(passed[risen])), passed[fallen]
    count = usual / float(np.median(counted[risen]))  # s
    if count <= 0.0 or not np.all(leaps > _STRETCH * usual):
        return
    time, steps = counts * count, counted * count
    falls = steps[fallen]
    loose = _evenness(time, steps, usual)
    fits = [size for size in _powers(count) if np.ptp(time) < size and np.all(np.abs(falls + size - usual) <= loose)]
    if not fits:
        return
    k, moves = int(np.argmax(fallen)), "falls" if rule.scale > 0.0 else "leaps"
    raise IdentifyError(
        f"{file}: {table.place} {table.places[k + 1]}, column {foreign}: {moves} by {-counted[k]:.10g}, from "
        f"{counts[k]:.10g} to {counts[k + 1]:.10g}, and with wraps = {rule.wraps:.10g} the clock goes on by "
        f"{leaps[0]:.6g} s there, where rows are {usual:.6g} s apart; {_shown(fits[0] / count)} fits every fall, which "
        f"is {_powers(count)[fits[0]]}: correct wraps",
        _wrapping_at(fits[0] / count, given),
    )


def _shown(counts: float) -> str:
    return str(round(counts)) if abs(counts - round(counts)) < 1e-9 * counts else f"{counts:.12g}"


def _wrapping_at(counts: float, given: tuple[str, Column]) -> str:
    """Return the lines that say where a clock wraps, as the file counts."""
    foreign, rule = given
    kept = f", scale = {rule.scale!r}" if rule.scale != 1.0 else ""
    line = rename_line(foreign, "time_s", rule.unit or "s").removesuffix(" }")
    return f"[recordings.rename]\n{line}{kept}, wraps = {_shown(counts)} }}"


def _counts_down(time: Array, steps: Array, given: tuple[str, Column], plain: str, table: RawTable) -> IdentifyError:
    """Tell a timer that counts down from rows that stand the last one first."""
    foreign, rule = given
    rises = np.flatnonzero(steps > 0.0)
    usual, count = float(np.median(-steps[steps < 0.0])), _count_of(given)
    found = _wrap(-time, -steps, usual, count, _goes_on(table, rises)) if len(rises) else None
    line = f"{rename_line(foreign, 'time_s', rule.unit or 's').removesuffix(' }')}, scale = {-rule.scale!r}"
    if found is None:
        much = "nearly every" if len(rises) else "every"
        return IdentifyError(
            f"{plain}: time must rise; it falls in {much} row: turn the rows around, if the last one came first; if "
            "they are in order, the clock counts down",
            f"[recordings.rename]\n{line} }}",
        )
    size, says = found
    return IdentifyError(
        f"{plain}: the clock counts down, and begins again from the top after {size:.10g} s, which is {says}. Turning "
        "or splitting the rows would tear the recording; keep every row and say so",
        f"[recordings.rename]\n{line}, wraps = {_shown(size / count)} }}",
    )


def _count_of(given: tuple[str, Column]) -> float:
    """Return how long one count of the file is, s."""
    rule = given[1]
    return rule.scale * (conversion(rule.unit, "s", "").factor if rule.unit else 1.0)


def _other_clock(table: RawTable, stuck: NDArray[np.intp]) -> tuple[str, float] | None:
    """Return the name and the step of a column that rises as only a time does, where time_s is none; no row number."""
    if len(stuck) <= max(2, _SHARE * len(table.places)):
        return None
    for name, column in zip(table.names, table.columns, strict=True):
        steps = np.diff(column)
        usual = float(np.median(steps))
        if name != "time_s" and usual > 0.0 and usual != 1.0 and float(np.ptp(steps)) < _EVEN * usual:
            return name, usual
    return None


def _displaced(time: Array) -> int:
    """Return by how many rows the one farthest from the place that its stamp gives it is away from there."""
    places = np.argsort(np.argsort(time, kind="stable"), kind="stable")
    return int(np.max(np.abs(places - np.arange(len(time)))))


def _copies(stuck: NDArray[np.intp]) -> str:
    """Say that the rows after those `stuck` are copies of them, reading by reading: no digit of a stamp is lost."""
    again = 1 + int(np.max(np.diff(np.append(np.flatnonzero(np.diff(stuck, prepend=-2) > 1), len(stuck)))))
    if again > 2:
        return f"rows are written up to {again} times, the same in every column; keep the first of each"
    rows = "1 row is" if len(stuck) == 1 else f"{len(stuck)} rows are"
    return f"{rows} written twice, so delete the second of each"


def _fallen(time: Array, steps: Array, given: tuple[str, Column], plain: str, table: RawTable, k: int) -> IdentifyError:
    """Tell a counter that wraps from recordings in a row and rows out of order."""
    falls = steps[steps < 0.0]
    usual, count = float(np.median(steps[steps > 0.0])), _count_of(given)
    found = _wrap(time, steps, usual, count, _goes_on(table, np.flatnonzero(steps < 0.0)))
    if found:
        size, says = found
        return IdentifyError(
            f"{plain}: the clock is a counter that wraps: it falls by {-float(falls[0]):.10g} s, and {size:.10g} s is "
            f"{says}. Sorting would tear the recording; keep every row and say where the counter wraps",
            _wrapping_at(size / count, given),
        )
    fallen = np.flatnonzero(steps < 0.0)
    after, before = time[np.minimum(fallen + 2, len(time) - 1)], time[np.maximum(fallen - 1, 0)]
    alone = np.where(
        after > time[fallen], True, (fallen > 0) & (time[fallen + 1] > before)
    )  # the later, or the earlier
    if len(falls) <= _SHARE * len(time) and np.all(alone) and np.all(-falls > 2.0 * usual):
        wrong = np.where(after > time[fallen], fallen + 1, fallen)
        return IdentifyError(
            f"{plain}: time must rise; the rows around go on, so that "
            f"{_stamps_or_rows(time, wrong, usual, 'correct it or delete the row')}",
            _period_lines(time, wrong, usual),
        )
    parts = np.diff([0, *(fallen + 1), len(time)])  # rows of each recording, if so many it holds
    if np.all(-falls > 0.5 * (time[:-1][steps < 0.0] - time[0])) and np.min(parts) >= _FEWEST:
        return IdentifyError(
            f"{plain}: time must rise; it begins anew there, so that the file holds {len(falls) + 1} recordings: split "
            f"it before {table.place} {table.places[k + 1]} and list the parts in [recordings]"
        )
    back = f"{plain}: time must rise; it goes back {len(falls)} times, by up to {-float(falls.min()):.4g} s"
    if _displaced(time) > _SWAPPED:
        return IdentifyError(
            f"{back}: where the clock is a counter that wraps within a few rows, sorting would tear the recording: "
            "give the time between rows as recordings.period_s; sort the rows only if the file has them in no order"
        )
    return IdentifyError(
        f"{back}: sort the rows by time if the logger has swapped them, or split the file where a second recording "
        "begins"
    )


def _stamps_or_rows(time: Array, wrong: NDArray[np.intp], usual: float, cure: str) -> str:
    """Say what is wrong, stamps or the rows themselves, and the cure that fits, see `_period_lines`."""
    many = len(wrong)
    if _period_lines(time, wrong, usual):
        stamps = "one stamp is" if many == 1 else f"{many} stamps are"
        return f"{stamps} wrong: {cure}, or give the time between rows if they are even"
    if np.ptp(_away(np.delete(time, wrong), np.arange(len(time) - many), usual)) < 0.5:
        rows = "this row is" if many == 1 else f"{many} such rows are"
        return f"{rows} one too many, for without it the clock goes on evenly: delete {'it' if many == 1 else 'them'}"
    return f"{'one stamp is' if many == 1 else f'{many} stamps are'} wrong: {cure}"


def _leapt_too(time: Array, again: NDArray[np.intp], usual: float) -> bool:
    """Tell whether the stamps without those that come `again` keep to a grid as wide as a row, and leap over places.

    Even rows, rounded to such a grid, repeat one of its places and leap over another; one wrong stamp does so in two
    rows, and leaves the rest where the clock has it.
    """
    if _period_lines(time, again, usual):
        return False
    places = np.diff(np.delete(time, again)) / usual
    return bool(np.all(np.abs(places - np.round(places)) < _ON_GRID) and np.max(places) > 1.5)


def _period_lines(time: Array, wrong: NDArray[np.intp], usual: float) -> str:
    """Return the lines that give the rows an even period; blank where that would move the rows not `wrong` in time."""
    kept = np.delete(np.arange(len(time)), wrong)
    return f"[recordings]\nperiod_s = {usual:.6g}" if np.ptp(_away(time[kept], kept, usual)) < 0.5 else ""


def _away(time: Array, rows: NDArray[np.intp], usual: float) -> Array:
    """Return by how many rows the stamps are away from where an even clock has these rows."""
    return np.asarray(time / float(f"{usual:.6g}") - rows)


def _goes_on(table: RawTable, falls: NDArray[np.intp]) -> bool:
    """Tell whether a signal is away from where the file begins, and goes on as it was, wherever the clock falls.

    Another recording would begin as the first did.
    """
    for name, column in zip(table.names, table.columns, strict=True):
        step = float(np.quantile(np.abs(np.diff(column)), _USUAL))
        on = np.abs(column[falls + 1] - column[falls]) <= step
        away = np.abs(column[falls + 1] - column[0]) > _AWAY * step
        if name != "time_s" and np.all(on & away):
            return True
    return False


def _wrap(time: Array, steps: Array, usual: float, count: float, goes_on: bool) -> tuple[float, str] | None:
    """Return by how much the clock falls, s, and what that is.

    It is a power of two of its ticks; or the end of a minute, an hour, a day or a week, of a decimal counter, or of one
    of processor cycles: then the first row is not where such a clock begins, as a recording would. Of several the one
    that puts the row after it where an even clock has it; only where none does, the nearest power of two that makes
    no longer step than the others are: a clock that leaps farther there begins anew.
    """
    falls, begins = steps[steps < 0.0], time[1:][steps < 0.0]
    even = _evenness(time, steps, usual)
    anew = bool(np.all(np.abs(begins - time[0]) < 0.5 * usual))
    powers = _powers(count)
    begun = time[0] > float(begins.max()) + _STRETCH * usual
    tables = [(powers, even)]
    if begun or not anew or goes_on:
        tables += [({**_PRESCALED, **_CYCLES, **_DECIMAL, **_CALENDAR}, even)]
    if not anew or goes_on:  # what begins as the file does is another recording, unless its clock goes on to the row
        longest = max(0.5 * usual, float(steps.max()) - usual)  # the step across the end is like the others
        tables += [(powers, 0.5 * usual if anew else longest)]
    if begun:
        tables += [({**_CYCLES, **_DECIMAL, **_CALENDAR}, 0.5 * usual)]
    for table, loose in tables:
        fits = {
            float(np.max(np.abs(falls + size - usual))): (size, says)
            for size, says in table.items()
            if usual < 0.25 * size
            and time.max() - time.min() < size * (1.0 + 1e-9)
            and np.all((falls + size > 0.0) & (falls + size <= 0.5 * size + usual))
        }
        if fits and min(fits) <= loose:
            return fits[min(fits)]
    return None


def _powers(count: float) -> dict[float, str]:
    """Return where counters of so many bits wrap, s, and what that is."""
    ticks = (count, 1e-6, 1e-3, 1.0, 1e-9)
    return {tick * 2.0**bits: f"2^{bits} ticks of {tick:g} s" for tick in ticks for bits in _BITS}


def _evenness(time: Array, steps: Array, usual: float) -> float:
    """Return by how much the steps of a clock differ from the usual one, s, where its rows are even."""
    off = np.abs(steps[steps > 0.0] - usual)
    return min(0.45 * usual, 2.0 * float(np.quantile(off, 0.95)) + 4.0 * float(np.spacing(np.abs(time).max())))


def _even_period(time: Array) -> tuple[float, float, float] | None:
    """Return the period of rows that are even but for the digits their stamps have lost, and the range it is in.

    A stamp changes between two rows: of any two changes, the time between them and the rows between them bound the
    period. Where stamps grow by a digit, those of the longest count. Of all periods in the range it is the one with the
    fewest digits, as somebody has set it.
    """
    size = np.floor(np.log10(np.maximum(np.abs(time), 1e-300)))
    longest = time[size == size.max()]
    alike = longest if np.sum(np.diff(longest) > 0.0) > _CHANGES else time
    changes = np.flatnonzero(np.diff(alike) > 0.0) + 1
    if len(changes) < 2:
        return None
    moved, rows = alike[changes[1:]] - alike[changes[0]], changes[1:] - changes[0]
    slack = 4.0 * float(np.spacing(np.abs(time).max()))
    low = float(np.max((moved - slack) / (rows + 1)))
    bounded = rows > 1
    high = float(np.min((moved + slack)[bounded] / (rows[bounded] - 1))) if np.any(bounded) else 2.0 * low
    tick = float(np.diff(alike)[changes - 1].min())
    middle = 0.5 * (low + high)
    nice = (float(f"{middle:.{digits}e}") for digits in range(13))
    period = next((one for one in nice if low <= one <= high), middle)
    off = time - time[0] - period * np.arange(len(time))
    even = low <= high and float(off.max() - off.min()) <= _LOOSE * tick
    return (period, low, high) if even else None
