"""Tell what a black-box model is like."""

from __future__ import annotations

import math

from firmloop.console import table
from firmloop.presentation.documents import finite, known
from firmloop.presentation.words import rounded_to
from firmloop.stages.bench.black_box import BlackBox, gain_at_rest, poles_of, white


def about_model(found: BlackBox) -> list[str]:
    """Gain and poles with their 95 % intervals, and how well each recording is predicted."""
    structure, made, judged, spread = found.structure, found.made, found.judged, found.spread
    poles, halves = poles_of(made), [] if spread is None else spread["poles_rad_s"]
    assert isinstance(halves, list)
    words = [f"{p.real:.2g}" if abs(p.imag) <= 1e-9 * abs(p) else f"{p.real:.2g}{p.imag:+.2g}j" for p in poles]
    lines = [f"model: {structure} of order {len(made.a)}, delay {made.delay:g} s"]
    gain, integrates = gain_at_rest(made), "it integrates, so it has no gain at rest"
    if spread is None:
        rests = f"gain at rest {gain:.2g}" if math.isfinite(gain) else integrates
        lines.append(f"  {rests}, poles {', '.join(words)} rad/s")
        why = "they need structure = 'arx' or 'oe'"
        if structure != "n4sid" and white(judged["train"]):
            why = "with its residuals drawn anew the model has no continuous form any more; lower order"
        elif structure != "n4sid":
            why = "the residuals are not white, so that drawing them anew repeats nothing; raise order"
        lines.append(f"  note: no intervals; {why}")
    else:
        half = spread["gain"]
        lines.append(f"  {integrates}" if half is None else f"  gain at rest  {_with(gain, half)}")
        for pole, (real, imaginary) in zip(poles, halves, strict=True):
            turning = "" if abs(pole.imag) <= 1e-9 * abs(pole) else f", {_with(pole.imag, imaginary)} j"
            lines.append(f"  pole          {_with(pole.real, real)}{turning} rad/s")
    rows = [
        (
            f"{role} {entry['recording']}",
            f"fit {entry['fit_percent']:.1f} %",
            f"rmse {entry['rmse']:.3g}",
            f"white {entry['whiteness']:.2g}",
            f"independent of the input {entry['independence']:.2g}",
        )
        for role, entries in judged.items()
        for entry in entries
    ]
    return lines + table(rows) + [f"  note: {note}" for note in (*found.notes, found.cut) if note]


def _with(value: float, half: object) -> str:
    """Write a value with its half width, and no digit beyond it."""
    assert isinstance(half, float)
    return f"{value:.3g}" if half == 0.0 else f"{rounded_to(value, half)} ± {half:.2g}"


def model_document(found: BlackBox) -> dict[str, object]:
    """Return what `--json` and model.json say."""
    sampled, made = found.sampled, found.made
    return {
        "structure": found.structure,
        "order": len(made.a),
        "period_s": found.period,
        "delay_s": made.delay,
        "delays_alike_s": [found.delays.least * found.period, found.delays.most * found.period],
        "discrete": {"a": sampled.a.tolist(), "b": sampled.b.tolist(), "c": sampled.c.tolist()},
        "continuous": {"a": made.a.tolist(), "b": made.b.tolist(), "c": made.c.tolist()},
        "poles_rad_s": [[float(pole.real), float(pole.imag)] for pole in poles_of(made)],
        "gain": finite(gain_at_rest(made)),
        **{role: known(entries) for role, entries in found.judged.items()},
        "ci95_half": found.spread,
    }
