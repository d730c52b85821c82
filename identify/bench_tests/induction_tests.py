r"""Parameters of a single-phase induction motor from its standard tests, each with its formula's source.

The procedure is that of IEEE Std 114 (Test Procedure for Single-Phase Induction Motors): resistance by direct current,
locked rotor and no load on the main winding alone, and locked rotor on the auxiliary winding alone. The formulas are
those of Chapman, Electric Machinery Fundamentals, 5th ed., section 9.6, and of Fitzgerald, Kingsley and Umans,
Electric Machinery, 6th ed., section 9.3, for the circuit of `revolving_field.py`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from firmloop.identify.error import IdentifyError

COPPER = 234.5  # degC below zero at which a copper winding would have no resistance (IEEE Std 114)
POUND_FOOT = 1.3558179483  # N m
POUND_FOOT_SQUARED = 0.0421401101  # kg m^2
HORSEPOWER = 745.69987158  # W


@dataclass(frozen=True, slots=True)
class AcTest:
    """Readings of one test with alternating current: rms voltage and current, power."""

    voltage: float  # V
    current: float  # A
    power: float  # W


@dataclass(frozen=True, slots=True)
class LockedRotor:
    """Series resistance and reactance of one winding with the rotor held."""

    resistance: float  # ohm
    reactance: float  # ohm


def winding_resistance(voltage: float, current: float) -> float:
    """Return R = V / I of a test with direct current, ohm."""
    _positive("the direct voltage", voltage, "V")
    _positive("the direct current", current, "A")
    return voltage / current


def at_temperature(resistance: float, measured_at: float, wanted_at: float) -> float:
    """Convert a copper resistance between two temperatures in degC: R2 = R1 (234.5 + t2) / (234.5 + t1)."""
    return resistance * (COPPER + wanted_at) / (COPPER + measured_at)


def locked_rotor(test: AcTest) -> LockedRotor:
    """Return R = P / I^2 and X = sqrt((V/I)^2 - R^2)."""
    impedance = _impedance("the locked-rotor test", test)
    resistance = test.power / test.current**2
    return LockedRotor(resistance, math.sqrt(impedance**2 - resistance**2))


def rotor_resistance(locked: LockedRotor, winding: float) -> float:
    """Return R2 = R_locked - R1, ohm; slip 1 puts both halves of the rotor in series."""
    if locked.resistance <= winding:
        raise IdentifyError(
            f"the locked rotor shows {locked.resistance:.4g} ohm, not more than the {winding:.4g} ohm of the winding "
            "alone, which leaves nothing for the rotor; measure both at one temperature, or correct one of them"
        )
    return locked.resistance - winding


def leakage_reactance(locked: LockedRotor) -> float:
    """Return X1 = X2 = X_locked / 2, ohm: the usual split where nothing tells them apart."""
    return locked.reactance / 2


def magnetizing_reactance(no_load: AcTest, leakage: float) -> float:
    """Return Xm = 2 (X_0 - X1 - X2/2), ohm, with X1 = X2 = `leakage`.

    Without load the forward rotor branch is open and the backward one is a short circuit: the winding shows
    X1 + Xm/2 + X2/2.
    """
    impedance = _impedance("the no-load test", no_load)
    resistance = no_load.power / no_load.current**2
    shown = math.sqrt(impedance**2 - resistance**2)
    if shown <= 1.5 * leakage:
        raise IdentifyError(
            f"the no-load test shows a reactance of {shown:.4g} ohm, and 1.5 times the leakage of {leakage:.4g} ohm is "
            "already more; the two tests contradict each other: check voltage and current of both"
        )
    return 2 * (shown - 1.5 * leakage)


def rotational_loss(no_load: AcTest, winding: float, rotor: float) -> float:
    """Return P_0 - I_0^2 (R1 + R2/4), W: what no copper explains."""
    return no_load.power - no_load.current**2 * (winding + rotor / 4)


def turns_ratio(forward_emf: float, backward_emf: float, main: float, aux: float) -> float:
    """Return a = sqrt(Ea Vm / (Em Va)) of Veinott's test, effective turns auxiliary to main.

    The motor idles on the main winding at `main` (V) while the auxiliary one shows `forward_emf` (V); then it idles on
    the auxiliary winding at `aux` (V) while the main one shows `backward_emf` (V). (Veinott, Theory and Design of
    Small Induction Motors, chapter on capacitor motors.)
    """
    for what, size in {"first open winding": forward_emf, "second open winding": backward_emf}.items():
        _positive(f"the voltage of the {what}", size, "V")
    _positive("the main voltage", main, "V")
    _positive("the auxiliary voltage", aux, "V")
    return math.sqrt(forward_emf * aux / (main * backward_emf))


def _impedance(what: str, test: AcTest) -> float:
    _positive(f"the voltage of {what}", test.voltage, "V")
    _positive(f"the current of {what}", test.current, "A")
    _positive(f"the power of {what}", test.power, "W")
    apparent = test.voltage * test.current
    if test.power > apparent:
        raise IdentifyError(
            f"{what}: {test.power:g} W is more than {test.voltage:g} V times {test.current:g} A = {apparent:g} VA; "
            "the power factor would be above 1: correct one of the three readings"
        )
    return test.voltage / test.current


def _positive(what: str, size: float, unit: str) -> None:
    if not (math.isfinite(size) and size > 0):
        raise IdentifyError(f"{what} is {size:g} {unit}; it must be finite and above 0")
