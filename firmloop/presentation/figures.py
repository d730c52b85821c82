"""Draw the report's figures as SVG: the same data gives the same bytes."""

from __future__ import annotations

import html
import io
import itertools
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.transforms import Bbox

    from firmloop.stages.bode import Bode
    from firmloop.verify.verdict import Searches

Array = NDArray[np.float64]

INK = "#0a0b0c"  # stands for the color of the text around the figure
MODEL, DATA, DRIVE, LIMIT = "#e4572e", "#4c86b8", "#2a9d62", "#8a8f98"  # readable on white and on black
WIDE, FINE = 1.9, 0.9  # of the recorded and of every other curve: both are seen where they agree
COLUMNS = 500  # a curve keeps the lowest and the highest sample of this many stretches
SVG_DPI = 72  # of matplotlib's SVG: a unit is a point
DOT = 1.5  # points, of a dot of a scatter
_STROKE = re.compile(r"M ([-\d.]+ [-\d.]+) *\nL \1 *\n")
_NEEDLESS = re.compile(r"(?<=\.\d)\d+")
FARTHEST = 1e100  # that is drawn: ticks are multiples of a span, and leave all numbers near the end of them
STYLE: Mapping[str, Any] = {
    "svg.hashsalt": "firmloop",
    "svg.fonttype": "none",
    "font.family": "sans-serif",
    "font.size": 9.0,
    "axes.edgecolor": INK,
    "axes.labelcolor": INK,
    "axes.titlecolor": INK,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.titlesize": 9.5,
    "axes.titlelocation": "left",
    "axes.titley": 1.0,  # its own choice among two heights costs a layout of all that is there
    "axes.linewidth": 0.6,
    "text.color": INK,
    "text.parse_math": False,
    "xtick.color": INK,
    "ytick.color": INK,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "grid.color": LIMIT,
    "grid.alpha": 0.25,
    "grid.linewidth": 0.5,
    "legend.frameon": False,
    "legend.fontsize": 8.5,
    "axes.grid": True,
}


@dataclass(frozen=True, slots=True)
class CurvePair:
    """One recorded output beside its prediction: arrays (n,), time in s, the others in `unit`; below it its inputs."""

    title: str
    output: str
    unit: str
    time: Array
    measured: Array
    simulated: Array
    inputs: tuple[tuple[str, str, Array], ...] = ()  # name, unit and values (n,)


@dataclass(frozen=True, slots=True)
class Step:
    """One closed-loop step: arrays (n,), time in s; `limits` are those of the output."""

    time: Array
    reference: Array
    measurement: Array
    output: Array
    measured_unit: str
    output_unit: str
    limits: tuple[float, float]


def comparison_figure(comparison: CurvePair) -> str:
    """Draw recording and model above, then what is left between them, then the inputs."""
    driven = comparison.inputs
    with styled(8.6, 3.3 + 1.0 * len(driven)) as figure:
        ratios = (2.4, *[1] * (1 + len(driven)))
        above, below, *drives = figure.subplots(len(ratios), 1, sharex=True, height_ratios=ratios, squeeze=True)
        _draw_comparison(above, comparison)
        _curve(below, comparison.time, comparison.measured - comparison.simulated, LIMIT, "residual")
        below.set_ylabel(_label("residual", comparison.unit))
        for axes, (name, unit, values) in zip(drives, driven, strict=True):
            _curve(axes, comparison.time, values, DRIVE, name)
            axes.set_ylabel(_label(name, unit))
        figure.axes[-1].set_xlabel("time, s")
        figure.align_ylabels()
        return labelled(comparison.title, svg(figure))


def labelled(says: str, picture: str) -> str:
    """Put a picture into a page, with a name for who does not see it; on a narrow screen it can be scrolled."""
    name = html.escape(says)
    seen = f'<div role="img" aria-label="{name}">{picture}</div>'
    return f'<div class="scroll" role="group" aria-label="figure: {name}" tabindex="0">{seen}</div>'


def step_figure(step: Step) -> str:
    """Draw reference and measurement above, the output with its limits below."""
    with styled(8.6, 3.6) as figure:
        above, below = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2), squeeze=True)
        _draw_step(above, step)
        _draw_drive(below, step)
        below.set_xlabel("time, s")
        return labelled("closed loop: reference, measurement and output", svg(figure))


def bode_figure(bode: Bode, crossover: float) -> str:
    """Draw gain and phase of the open loop over frequency, each with its interval."""
    with styled(8.6, 3.8) as figure:
        above, below = figure.subplots(2, 1, sharex=True, squeeze=True)
        for axes, values, half, name in (
            (above, bode.gain, bode.gain_half, "gain\ndB"),
            (below, bode.phase, bode.phase_half, "phase\ndeg"),
        ):
            if half is not None and np.all(np.isfinite(half)):
                axes.fill_between(bode.frequency, values - half, values + half, color=DATA, alpha=0.3, linewidth=0)
            axes.plot(bode.frequency, values, color=DATA, linewidth=WIDE)
            axes.set_ylabel(name)
            if bode.frequency[0] < crossover < bode.frequency[-1]:
                axes.axvline(crossover, color=LIMIT, linestyle=":", linewidth=1.0)
        above.set_xscale("log")
        below.xaxis.set_major_formatter("{x:g}")  # its own would be a formula
        above.set_title("open loop" if bode.gain_half is None else "open loop, with 95 % intervals")
        below.set_xlabel("frequency, rad/s")
        figure.align_ylabels()
        return labelled("gain and phase of the open loop over frequency", svg(figure))


def search_figure(found: Searches, ink: str = "currentColor") -> str:
    """Draw which limits were active in each step, the work of its search, and its instructions; `ink` is the text's."""
    from matplotlib.colors import to_rgba

    side, steps = np.array(found.side), np.arange(found.begins, found.begins + len(found.work))
    with styled(8.6, 4.6) as figure:
        limits, work, count = figure.subplots(3, 1, sharex=True, height_ratios=(3, 2, 2), squeeze=True)
        shown = np.zeros((*side.T.shape, 4))
        for value, color, label in ((1, MODEL, "at its high limit"), (-1, DATA, "at its low limit")):
            shown[side.T == value] = to_rgba(color)
            limits.plot([], [], "s", color=color, label=label, markersize=4.0)
        edges = (steps[0] - 0.5, steps[-1] + 0.5, side.shape[1] - 0.5, -0.5)
        limits.imshow(shown, extent=edges, aspect="auto", interpolation="nearest")
        limits.set_title("the steps about the one that took longest")
        limits.set_ylabel("row")
        _legend(limits)
        work.step(steps, found.work, color=DRIVE, where="mid", linewidth=FINE)
        work.set_ylabel("work")
        count.step(steps, found.instructions, color=DRIVE, where="mid", linewidth=FINE)
        count.set_ylabel("instructions")
        count.set_xlabel("step")
        return svg(figure, ink)


def overview(comparison: CurvePair, step: Step | None, verdict: Sequence[str]) -> str:
    """Draw a walk in one picture: data and model, closed loop, and the verdict's lines."""
    with styled(10.0, 2.7 + 0.2 * len(verdict)) as figure:
        bottom = (0.55 + 0.2 * len(verdict)) / figure.get_figheight()
        left, right = figure.subplots(1, 2, squeeze=True)
        figure.subplots_adjust(bottom=bottom, top=0.93, left=0.06, right=0.99, wspace=0.14)
        _draw_comparison(left, comparison)
        if step:
            _draw_step(right, step)
        for axes in (left, right):
            axes.set_xlabel("time, s")
        for row, line in enumerate(verdict):
            height = 0.2 * (len(verdict) - 1 - row) / figure.get_figheight()
            figure.text(0.06, height, line, family="monospace", fontsize=9)
        return svg(figure, LIMIT)


@contextmanager
def styled(width: float, height: float) -> Iterator[Figure]:
    """Give an empty figure of that size in inches; a user's own matplotlibrc changes nothing in it."""
    import matplotlib
    from matplotlib.figure import Figure

    settings: dict[Any, Any] = dict(matplotlib.rcParamsDefault)
    settings.update(STYLE)
    with matplotlib.rc_context(settings):
        yield Figure(figsize=(width, height))


def _draw_comparison(axes: Axes, comparison: CurvePair) -> None:
    _curve(axes, comparison.time, comparison.measured, DATA, "recorded")
    _curve(axes, comparison.time, comparison.simulated, MODEL, "model")
    axes.set_title(comparison.title)
    axes.set_ylabel(_label(comparison.output, comparison.unit))
    _legend(axes)


def _draw_step(axes: Axes, step: Step) -> None:
    told = np.where(np.abs(step.reference) < FARTHEST, step.reference, np.nan)
    axes.step(step.time, told, color=LIMIT, where="post", label="reference", linestyle="--")
    _curve(axes, step.time, step.measurement, DATA, "measurement")
    axes.set_title("closed loop")
    axes.set_ylabel(_label("measurement", step.measured_unit))
    _legend(axes)


def _draw_drive(axes: Axes, step: Step) -> None:
    _curve(axes, step.time, step.output, DRIVE, "output")
    low, high = float(step.output.min()), float(step.output.max())
    for limit in step.limits:
        # A limit far from where the output moves would flatten the curve.
        if low - (high - low) <= limit <= high + (high - low):
            axes.axhline(limit, color=LIMIT, linestyle=":", linewidth=1.0)
    axes.set_ylabel(_label("output", step.output_unit))


def _legend(axes: Axes) -> None:
    """Put the legend above the plot, where no curve can run through it."""
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 0.98), ncols=2, borderaxespad=0.0)


def _label(name: str, unit: str) -> str:
    return f"{name}\n{unit or '1'}"  # in two lines, for which there is room beside the lowest of axes


def _curve(axes: Axes, time: Array, values: Array, color: str, label: str) -> None:
    drawn = np.where(np.abs(values) < FARTHEST, values, np.nan)  # a run that left all numbers ends where it left
    thin_time, thin_values = thinned(time, drawn, COLUMNS)
    axes.plot(thin_time, thin_values, color=color, label=label, linewidth=WIDE if color == DATA else FINE)


def dots(axes: Axes, across: Array, up: Array, color: str) -> None:
    """Draw a dot at each place (n,): strokes of no length, one path of all, where marks are elements of their own."""
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path

    strokes = Path(np.repeat(np.column_stack([across, up]), 2, axis=0), [Path.MOVETO, Path.LINETO] * len(up))
    strokes.should_simplify = False  # which would leave out what has no length
    axes.add_patch(PathPatch(strokes, fill=False, edgecolor=color, linewidth=DOT, capstyle="round"))
    axes.autoscale_view()


def thinned(time: Array, values: Array, columns: int) -> tuple[Array, Array]:
    """Keep the lowest and the highest sample of each of `columns` stretches: on paper the curve is the same."""
    if len(values) <= 2 * columns:
        return time, values
    edges = np.linspace(0, len(values), columns + 1).astype(int)
    kept = {0, len(values) - 1}
    for begin, end in itertools.pairwise(edges):
        kept.update((begin + int(np.argmin(values[begin:end])), begin + int(np.argmax(values[begin:end]))))
    order = np.array(sorted(kept))
    return time[order], values[order]


def svg(figure: Figure, ink: str = "currentColor") -> str:
    """Return the picture as text without date, version or needless digits; INK becomes `ink`."""
    stream = io.StringIO()
    figure.savefig(
        stream, format="svg", transparent=True, bbox_inches=_extent(figure), metadata={"Date": None, "Creator": None}
    )
    text = stream.getvalue()
    text = text[text.index("<svg") :].replace(INK, ink)
    return re.sub(r' d="[^"]*', lambda path: _STROKE.sub(r"M\1h0", _NEEDLESS.sub("", path[0])), text)


def _extent(figure: Figure) -> Bbox:
    """Return what `bbox_inches="tight"` crops to, without the drawing that matplotlib makes first to find it."""
    import matplotlib
    from matplotlib.backends.backend_svg import RendererSVG

    figure.dpi = SVG_DPI
    nowhere = RendererSVG(*figure.bbox.size, io.StringIO(), image_dpi=SVG_DPI)  # type: ignore[no-untyped-call]
    return figure.get_tightbbox(nowhere).padded(matplotlib.rcParams["savefig.pad_inches"])
