"""Put the two halves of a loop into one finding: what the plant's half says, and what the controller's does."""

from __future__ import annotations

from dataclasses import replace

from firmloop.diagnose.controller.replay import Blame, Cut
from firmloop.diagnose.finding import Alternative, Estimate, Finding, Location, Named
from firmloop.diagnose.policy import SURE_FAULT, TIED_FAULT
from firmloop.identify.normal import NORMAL_95


def with_controller(finding: Finding, cut: Cut | None) -> Finding:
    """Return the finding of the plant's half with that of the controller's, which stands first where it is guilty."""
    if cut is None:
        return finding
    said = _says(cut)
    notes = (*finding.notes, *cut.notes)
    if not cut.guilty:
        return replace(finding, notes=notes, says=(*finding.says, *said, *_noted(cut)))
    named = tuple(_named(each, cut) for each in cut.blames)
    verdict = finding.verdict
    if verdict == "no_mismatch":
        verdict = "explained" if named else "unknown_physics"
    return replace(
        finding,
        verdict=verdict,
        half="controller",
        location=_location(cut),
        effects=(*named, *finding.effects),
        alternatives=(*_alternatives(cut), *finding.alternatives),
        notes=notes,
        says=(*said, *(each.says for each in named), *_plant(finding), *_noted(cut)),
    )


def _plant(finding: Finding) -> tuple[str, ...]:
    """Return what the plant's half says, told to be that."""
    if finding.verdict == "no_mismatch":
        return ("The plant half, simulated from the recorded command, shows nothing:", *finding.says)
    return ("The plant half, simulated from the recorded command, differs too:", *finding.says)


def _says(cut: Cut) -> tuple[str, ...]:
    if cut.samples == 0:
        return ()
    replayed = f"The controller half, replayed bit for bit from the recorded inputs ({cut.samples} samples)"
    if not cut.guilty:
        if cut.same >= 0.99 * cut.samples:
            return (f"{replayed}, answers {cut.command} as recorded, within its digits.",)
        return (f"{replayed}, answers {cut.command} within what the recording resolves.",)
    worst = f"{cut.worst:.3g} {cut.unit}"
    if cut.worst == 0.0 or cut.same >= 0.99 * cut.samples:
        return (f"{replayed}, computes the recorded {cut.command}, but at other times.",)
    line = f"{replayed}, does not answer {cut.command} as recorded"
    line = f"{line}: {cut.samples - cut.same} samples differ, by up to {worst}"
    if cut.unexplained:
        return (f"{line}; no single gain, limit, delay, period or sign explains it, so compare the firmware's law.",)
    return (f"{line}. {100.0 * (1.0 - cut.left):.3g} % of that is explained:",)


def _noted(cut: Cut) -> tuple[str, ...]:
    return tuple(f"Note: {note}." for note in cut.notes[:3])


def _location(cut: Cut) -> Location:
    blame = cut.blames[0] if cut.blames else None
    evidence = (
        f"the recorded {cut.command} is up to {cut.worst:.3g} {cut.unit} from what the controller answers to the "
        "recorded inputs"
    )
    return Location("controller", "" if blame is None else blame.fault.what, cut.command, cut.spans, evidence)


def _alternatives(cut: Cut) -> tuple[Alternative, ...]:
    share = TIED_FAULT / max(len(cut.others), 1)
    return tuple(
        Alternative(
            f"{each.fault.name}: {each.fault.what}",
            share,
            "record steps of the reference that are large enough to reach the limits, and a stretch at rest",
        )
        for each in cut.others[:4]
    )


def _named(blame: Blame, cut: Cut) -> Named:
    estimates = _estimates(blame, cut)
    sure = TIED_FAULT if cut.others and blame is cut.blames[-1] else SURE_FAULT
    return Named(blame.fault.name, None, "controller", sure, estimates, _sentence(blame, cut))


def _estimates(blame: Blame, cut: Cut) -> dict[str, Estimate]:
    fault, figure = blame.fault, blame.figure
    interval = None
    if blame.deviation is not None:
        reach = NORMAL_95 * blame.deviation
        interval = (figure - reach, figure + reach)
    if fault.name == "controller_delay":
        late = figure * blame.match.sample_s
        return {"samples": Estimate(figure, None, "1"), "delay_s": Estimate(late, None, "s")}
    if fault.name == "controller_period":
        return {"period_s": Estimate(figure, None, "s")}
    if fault.name == "controller_saturation":
        limits = blame.match.guess.limits
        if fault.what == "other" and limits is not None:
            return {key: Estimate(end, None, cut.unit) for key, end in zip(("u_min", "u_max"), limits, strict=True)}
        return {"reached": Estimate(figure, None, cut.unit)}
    if fault.name == "controller_gain":
        return {fault.what: Estimate(figure, interval, fault.unit or "1")}
    if fault.name in ("controller_sign", "controller_scale"):
        return {"factor": Estimate(figure, interval, "1")}
    return {}


def _sentence(blame: Blame, cut: Cut) -> str:
    fault, figure = blame.fault, blame.figure
    reach = "" if blame.deviation is None else f" ± {NORMAL_95 * blame.deviation:.2g}"
    if fault.name == "controller_gain":
        unit = f" {fault.unit}" if fault.unit else ""
        return (
            f"The firmware computes with {fault.what} = {figure:.5g}{reach}{unit}, the project says {fault.given:.5g} "
            f"({figure / fault.given:.4g} times)."
        )
    if fault.name == "controller_saturation":
        return _about_limits(blame, cut)
    if fault.name == "controller_delay":
        what = "The command" if fault.what == "command" else f"The controller's input {fault.what}"
        late = figure * blame.match.sample_s
        return f"{what} comes {figure:.0f} sample{'s' if figure > 1 else ''} ({1e3 * late:.4g} ms) late."
    if fault.name == "controller_period":
        if fault.what == "computed for":
            return (
                f"The firmware computes with figures for a period of {figure:.4g} s, but steps every "
                f"{fault.given:.4g} s as the project says."
            )
        told = "its figures are those of that period" if fault.what == "figures" else "with figures for the project's"
        return f"The firmware steps every {figure:.5g} s, the project says {fault.given:.5g} s; {told}."
    where = "its output" if fault.what == "output" else f"its input {fault.what}"
    if fault.name == "controller_sign":
        return f"The firmware takes {where} with the opposite sign."
    if fault.name == "controller_scale":
        return f"The firmware takes {where} {figure:.5g}{reach} times as large: another unit or scale."
    if fault.name == "controller_anti_windup":
        return f"The firmware's integral behaves at the limits as with anti_windup = '{fault.what}'."
    return "The firmware computes without the project's feedforward."


def _about_limits(blame: Blame, cut: Cut) -> str:
    fault, limits = blame.fault, blame.match.guess.limits
    if fault.what == "other" and limits is not None:
        low, high = limits
        return f"The firmware limits {cut.command} to {low:.5g}..{high:.5g} {cut.unit}, not to the project's range."
    known = "although its integral behaves as if it were" if fault.what == "output alone" else "nor is its integral"
    return (
        f"The firmware's saturation is missing: {cut.command} reaches {fault.figure:.4g} {cut.unit} and is not limited "
        f"to {fault.given:.4g} {cut.unit}, {known}."
    )
