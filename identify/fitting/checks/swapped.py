"""Two columns that bear each other's name: the plant as given fits a recording only once they are exchanged."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations
from types import MappingProxyType

from firmloop.identify.fitting.check import Check
from firmloop.identify.fitting.evidence import Evidence, unexplained
from firmloop.identify.fitting.fit import tried
from firmloop.identify.recordings.columns import rename_line
from firmloop.identify.recordings.recording import Recording
from firmloop.identify.units import unit_of

_ALIKE = 0.8  # correlation of every output with the plant as given, once they are exchanged
_BETTER = 0.4  # of what is not explained as the columns are, as given and fitted


def look(evidence: Evidence) -> tuple[str, ...]:
    """Exchange every two columns of each recording that the plant as given does not explain."""
    return tuple(says for recording in evidence.recordings if (says := _exchanged(evidence, recording)))


def _exchanged(evidence: Evidence, recording: Recording) -> str:
    plain = unexplained(evidence, recording)
    if plain is None:
        return ""
    plant = evidence.given
    names = [signal.name for signal in (*plant.inputs, *plant.outputs) if signal.name in recording.columns]
    ways = {pair: unexplained(evidence, _with_exchanged(recording, *pair)) for pair in combinations(names, 2)}
    known = {pair: shares for pair, shares in ways.items() if shares is not None}
    if not known:
        return ""
    (one, other), shares = min(known.items(), key=lambda each: sum(each[1]))
    if max(shares) > 1.0 - _ALIKE**2 or sum(shares) > _BETTER * sum(plain):
        return ""
    again = tried(plant, [_with_exchanged(recording, one, other)], evidence.conditioning, near=True)
    fit = evidence.fit
    most = max(shares) if fit is None else min(max(shares), _BETTER * (1.0 - fit.explained))
    if again is None or 1.0 - again.explained > most:
        return ""  # a likeness that no values of the plant bear out, or less so than those of the columns as they are
    return (
        f"{one} and {other} of {recording.source} look exchanged: the plant as given then explains "
        f"{100.0 * (1.0 - max(shares)):.0f} % of every output, and {100.0 * (1.0 - max(plain)):.0f} % as the columns "
        f"are; exchange the two names in the file's header, or write in [recordings.rename], with the names of the "
        f"file on the left, {_line(one, other)} and {_line(other, one)}"
    )


def _line(foreign: str, name: str) -> str:
    unit = unit_of(name)  # which has to be said where the name of the file carries another
    return rename_line(foreign, name, unit) if unit else f'{foreign} = "{name}"'


def _with_exchanged(recording: Recording, one: str, other: str) -> Recording:
    held = recording.columns
    return replace(recording, columns=MappingProxyType({**held, one: held[other], other: held[one]}))


CHECK = Check(
    "swapped",
    look,
    ("clock_unit", "sign", "scale", "motor_constants", "early", "rest", "drift", "structure", "excitation"),
    False,
)
