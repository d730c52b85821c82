"""Tell which machines of a fleet are different, in what, and since when."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from firmloop.console import table
from firmloop.identify.normal import NORMAL_95
from firmloop.presentation.words import in_unit, rounded_to

if TYPE_CHECKING:
    from firmloop.stages.fleet.compare import Compared, Departure, Different, Typical
    from firmloop.stages.fleet.member import Member

HEAD = ("machine", "since", "what", "value", "95 % interval", "the others", "chance")
TYPICAL_HEAD = ("figure", "median", "from machine to machine", "unit")


def about_fleet(members: Sequence[Member], compared: Compared) -> list[str]:
    """Say how many differ, what is typical, then each machine that differs, and what could not be used."""
    machines = len({one.machine for one in members})
    lines = [f"fleet: {len(members)} recordings of {_count(machines, 'machine')}; {verdict(compared)}"]
    lines += table([TYPICAL_HEAD, *typical_rows(compared)]) if compared.typical else []
    lines += table(
        [HEAD, *(row for one in compared.different for row in different_rows(one))] * bool(compared.different)
    )
    lines += [f"  note: {line}" for line in notes(compared)]
    return lines + [f"  not used: {one.name}: {one.refused}" for one in members if one.refused]


def verdict(compared: Compared) -> str:
    """Say in half a sentence how the comparison ended."""
    if not compared.typical:
        return "not compared"
    if not compared.different:
        return "none differs from the others"
    return (
        f"{len(compared.different)} of them {'differs' if len(compared.different) == 1 else 'differ'} from the others"
    )


def notes(compared: Compared) -> list[str]:
    """Say what the whole type shows, what could not be compared, and how sure a name is."""
    shared = [
        f"most machines show {name}: it belongs to the type; put it into [[plant.effects]] of the project"
        for name in compared.shared
    ]
    without = [f"{figure} was not compared: {why}" for figure, why in compared.not_compared.items()]
    sure = [
        f"the chance that any machine of a fleet that is alike is listed is at most 5 %, over {compared.tests} figures"
    ]
    return [*shared, *without, *(sure if compared.tests else [])]


def typical_rows(compared: Compared) -> list[tuple[str, ...]]:
    """Give each figure: its median, and by how much machines differ (95 %)."""
    return [(one.figure, f"{one.centre:.4g}", _reach(one), one.unit) for one in compared.typical]


def different_rows(one: Different) -> list[tuple[str, ...]]:
    """Give a line an effect and a line a figure; machine and time stand on the first."""
    rows: list[tuple[str, ...]] = [
        (name, _value(each), _ends(each.get("ci95")), "most show none", _percent(effect["probability"]))
        for name, effect in one.effects.items()
        for each in _first(effect)
    ]
    rows += [_departure_row(each) for each in one.departures]
    heads = [(one.machine, _since(one))] + [("", "")] * (len(rows) - 1)
    return [(*head, *row) for head, row in zip(heads, rows, strict=True)]


def _departure_row(each: Departure) -> tuple[str, ...]:
    typical = each.typical
    half = None if each.value.deviation is None else NORMAL_95 * each.value.deviation
    shown = rounded_to(each.value.value, half) if half else f"{each.value.value:.3g}"
    ends = each.interval
    return (
        f"{each.figure} {change(each)}",
        in_unit(shown, typical.unit),
        "" if ends is None or not half else f"{rounded_to(ends[0], half)} to {rounded_to(ends[1], half)}",
        f"{typical.centre:.4g} {_reach(typical)}",
        f"{each.p:.1g}" if each.p > 0.0 else "0",
    )


def change(each: Departure) -> str:
    """Say by how much a figure is off the fleet's median."""
    typical = each.typical
    if not typical.logarithmic:
        return in_unit(f"{each.value.value - typical.centre:+.3g}", typical.unit)
    ratio = each.value.value / typical.centre
    return f"x {ratio:.3g}" if not 0.5 < ratio < 2.0 else f"{100.0 * (ratio - 1.0):+.3g} %"


def _reach(one: Typical) -> str:
    return f"± {100.0 * NORMAL_95 * one.between:.2g} %" if one.logarithmic else f"± {NORMAL_95 * one.between:.2g}"


def _since(one: Different) -> str:
    if one.recordings == 1:
        return ""
    if one.since is None:
        return f"only {', '.join(each.rpartition('/')[2] for each in one.departing)}"
    later = len(one.departing) - one.departing.index(one.since)
    if later == one.recordings:
        return f"all {one.recordings} recordings"
    return f"{one.since.rpartition('/')[2]} (the last {later} of {one.recordings})"


def _first(effect: Mapping[str, object]) -> list[Mapping[str, object]]:
    """Return the first parameter of an effect; one without any has one empty line."""
    parameters = effect.get("parameters") or {"": {}}
    assert isinstance(parameters, Mapping)
    return [dict(next(iter(parameters.values())))]


def _value(parameter: Mapping[str, object]) -> str:
    return in_unit(f"{float(str(parameter['value'])):.3g}", str(parameter["unit"])) if parameter else ""


def _ends(ends: object) -> str:
    return f"{ends[0]:.3g} to {ends[1]:.3g}" if isinstance(ends, list | tuple) else ""


def _percent(probability: object) -> str:
    return f"{100.0 * probability:.0f} % sure" if isinstance(probability, float | int) else ""


def _count(number: int, what: str) -> str:
    return f"{number} {what}{'' if number == 1 else 's'}"


def fleet_document(members: Sequence[Member], compared: Compared, failed: Mapping[str, str]) -> Mapping[str, object]:
    """Return what fleet.json and `--json` hold."""
    return {
        "recordings": len(members),
        "machines": len({one.machine for one in members}),
        "typical": {
            one.figure: {
                "median": one.centre,
                "between": one.between,
                "relative": one.logarithmic,
                "unit": one.unit,
                "machines": one.machines,
            }
            for one in compared.typical
        },
        "different": [_different_document(one) for one in compared.different],
        "shared_effects": list(compared.shared),
        "not_compared": dict(compared.not_compared),
        "tests": compared.tests,
        "members": [
            {
                "machine": one.machine,
                "recording": one.name,
                "sha256": one.key.recording,
                "verdict": one.verdict,
                "effects": list(one.effects),
                "refused": one.refused or None,
            }
            for one in members
        ],
        "failed": dict(failed),
    }


def _different_document(one: Different) -> Mapping[str, object]:
    return {
        "machine": one.machine,
        "since": one.since,
        "recordings": list(one.departing),
        "effects": list(one.effects.values()),
        "departures": [
            {
                "figure": each.figure,
                "value": each.value.value,
                "ci95": None if each.interval is None else list(each.interval),
                "unit": each.typical.unit,
                "median": each.typical.centre,
                "z": each.z,
                "p": each.p,
            }
            for each in one.departures
        ],
    }
