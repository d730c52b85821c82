"""Tell what a stage made: lines for people, and its part of the JSON document."""

from __future__ import annotations

from typing import TYPE_CHECKING

from firmloop.presentation import documents, words
from firmloop.presentation.code_words import about_code, about_unused_safe

if TYPE_CHECKING:
    from collections.abc import Sequence

    from firmloop.console import Console
    from firmloop.design.design import Design
    from firmloop.identify.fitting.fit import Fit
    from firmloop.stages.analysis import Loop
    from firmloop.stages.making import Generated


def tell_fit(console: Console, fit: Fit) -> None:
    """Parameters, intervals and scores."""
    console.lines(words.about_fit(fit))
    console.result("plant", documents.fit_document(fit))


def tell_design(console: Console, design: Design, loop: Loop | None) -> None:
    """Gains, margins and step metrics."""
    console.lines(words.about_design(design) + (words.about_loop(loop) if loop else []))
    console.result("controller", documents.design_document(design, loop))


def tell_code(console: Console, generated: Generated, safe: Sequence[float | None] = ()) -> None:
    """Files, number format, proofs and rounding; `safe` is what the project wants for an input that is no number."""
    without = about_unused_safe(generated, safe)
    console.lines(about_code(generated) + without)
    sizes = {name: len(text.encode()) for name, text in generated.bundle.files.items()}
    noted = {"notes": [line.strip() for line in without]} if without else {}
    console.result("code", {"manifest": generated.manifest, "bytes": sizes, **noted})
