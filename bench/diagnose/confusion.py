"""Count scored cases: the table of what came out against what is hidden."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np
from scipy.stats import beta

from bench.diagnose.scored import SHOWN, WORSE, Scored

CONFIDENCE = 0.95
COLUMNS = ("exact", "one function", "holds it", "wrong", "part", "silent", "unknown", "refused", "cut", "crash")


def kind_of(case: Scored) -> str:
    """Return the row of a case."""
    if case.truth.outside:
        return "not in the library" + ("" if case.truth.outside_visible >= SHOWN else ", below the noise")
    if not case.hidden:
        return f"nothing, {case.truth.about.get('color', 'colored' if case.truth.about['colored'] else 'white')} noise"
    word = {1: "single", 2: "pair", 3: "triple"}[len(case.hidden)]
    return word if case.visible else f"{word}, below the noise"


def column_of(case: Scored) -> str:
    """Return what came out of a case: one of COLUMNS."""
    if case.silent:
        return "silent"
    if case.verdict in ("refused", "cut", "crash"):
        return case.verdict
    if case.verdict == "unknown_physics":
        return "unknown"
    if case.exact:
        return "exact"
    if case.one_function:
        return "one function"
    if case.verdict == "ambiguous":
        return "holds it" if case.hidden and set(case.hidden) <= set(case.names) else "wrong"
    return "wrong" if case.wrong else "part"


def table(cases: Sequence[Scored]) -> list[str]:
    """Return the lines of the report.

    "holds it" is an ambiguous set that is wider than what is one function, "part" an explanation that lacks something.
    """
    rows: dict[str, Counter[str]] = {}
    for each in sorted(cases, key=kind_of):
        rows.setdefault(kind_of(each), Counter())[column_of(each)] += 1
    lines = [f"{'hidden':34}{'cases':>6}" + "".join(f"{name:>13}" for name in COLUMNS)]
    lines += [
        f"{kind:34}{n.total():6}" + "".join(f"{n[name] or '':>13}" for name in COLUMNS) for kind, n in rows.items()
    ]
    nulls = [each for each in cases if not each.hidden and not each.truth.outside]
    if nulls:
        lines.append(share("nothing hidden: false alarms", [column_of(e) in _ALARMS for e in nulls]))
        lines.append(f"  at {100 * CONFIDENCE:.0f} % a rate of {_between([column_of(e) in _ALARMS for e in nulls])}")
    lines.append(share("95 % intervals cover", [hit for each in cases for hit in each.covered]))
    simulated = [each for each in cases if each.worse > 0.0]
    lines.append(share("written project simulates worse than the plain refit", [e.worse > WORSE for e in simulated]))
    seconds = [each.seconds for each in cases] or [0.0]
    median, p90, most = np.quantile(seconds, (0.5, 0.9, 1.0))
    lines.append(f"CPU time per case, start included: median {median:.1f} s, p90 {p90:.1f} s, most {most:.1f} s")
    return [*lines, "", "what was hidden -> what was said, where they differ", *_differences(cases)]


_ALARMS = ("wrong", "part", "unknown", "exact", "one function", "holds it")


def _differences(cases: Sequence[Scored]) -> list[str]:
    found: dict[tuple[str, str], list[str]] = {}
    for each in cases:
        right = ("exact", "one function") if each.hidden else ("silent",)
        right = ("unknown",) if each.truth.outside else right
        if column_of(each) not in right:
            hidden = " + ".join(each.hidden) or each.truth.outside or "nothing"
            hidden += "" if each.visible or hidden == "nothing" else " (below the noise)"
            said = f"{each.verdict}: {' + '.join(sorted(each.names))}" if each.names else each.verdict
            found.setdefault((hidden, said), []).append(each.case)
    return [
        f"{len(names):4}  {hidden}  ->  {said}  [{' '.join(names[:4])}]"
        for (hidden, said), names in sorted(found.items())
    ]


def share(words: str, hits: Sequence[bool]) -> str:
    """Return a line that counts hits."""
    return f"{words}: {sum(hits)} of {len(hits)}" + (f" ({100.0 * sum(hits) / len(hits):.1f} %)" if hits else "")


def _between(hits: Sequence[bool]) -> str:
    low, high = interval(sum(hits), len(hits))
    return f"{100.0 * low:.1f} to {100.0 * high:.1f} %"


def interval(count: int, of: int) -> tuple[float, float]:
    """Return the two-sided interval of a rate (Clopper and Pearson, Biometrika 26 (1934) 404-413)."""
    tail = 0.5 * (1.0 - CONFIDENCE)
    low = float(beta.ppf(tail, count, of - count + 1)) if count else 0.0
    high = float(beta.ppf(1.0 - tail, count + 1, of - count)) if count < of else 1.0
    return low, high
