"""What the dead time of the bridges takes from each phase, given back: `[controller.feedforward] from = "effects"`.

The effect `dead_time` takes V sign(i) from a phase. With i_x* the current that the references ask of phase x::

    s_x   = min(max(i_x*/soft, -1), 1)                    x = a, b, c
    v_al += V (2 s_a - s_b - s_c)/3                       v_be += V (s_b - s_c)/sqrt(3)

The sign is that of the reference, which has no noise. What all three phases have in common is left out: it moves no
current. It comes behind the limit of the voltage, and the duties stay within 0 and 1.

`soft` in A is where the whole of V is given, by default 0.15 V/R: about as far from 0 as a bridge's own capacitances
make the sign of a current a line.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import casadi as ca

from firmloop.design.design import Request
from firmloop.design.law import DesignError
from firmloop.design.models.feedforward import NOT_MET
from firmloop.design.table import check_keys, choice, positive
from firmloop.identify.plants.attach import placed

NAME = "dead_time"
SOFT = 0.15  # of V/R
OUTER = "it acts on the shaft; the loop around, of speed, meets it"


@dataclass(frozen=True, slots=True)
class DeadTime:
    """V in V and `soft` in A."""

    voltage: float
    soft: float

    def share(self, reference_d: ca.SX, reference_q: ca.SX, turn: tuple[ca.SX, ca.SX], supply: ca.SX) -> list[ca.SX]:
        """Return what is added along alpha and beta, in shares of the supply; `turn`: cosine and sine of the angle."""
        cosine, sine = turn
        along, across = cosine * reference_d - sine * reference_q, sine * reference_d + cosine * reference_q
        half, side = 0.5 * along, (math.sqrt(3.0) / 2.0) * across
        a, b, c = (self._sign(current) for current in (along, side - half, -side - half))
        return [(self.voltage / 3.0) * (2.0 * a - b - c) / supply, (self.voltage / math.sqrt(3.0)) * (b - c) / supply]

    def _sign(self, current: ca.SX) -> ca.SX:
        return ca.fmin(ca.fmax(current, -self.soft), self.soft) * (1.0 / self.soft)


def dead_time_of(request: Request, resistance: float | None) -> tuple[DeadTime | None, Mapping[str, str]]:
    """Read `feedforward`: what is given back, and the plant's other effects with the reason why they are not met."""
    if "feedforward" not in request.table:
        return None, {}
    own = request.table["feedforward"]
    if not isinstance(own, Mapping):
        raise DesignError('controller.feedforward is not a table; write [controller.feedforward] with from = "effects"')
    try:
        check_keys(own, ("from", "soft"), "that of a foc")
        choice(own, "from", None, ("effects",))
        given = positive(own, "soft", None) if "soft" in own else None
    except DesignError as error:  # these speak of the controller's own keys
        raise DesignError(str(error).replace("controller.", "controller.feedforward.", 1)) from None
    voltage, missed = 0.0, {}
    for effect, _, at in placed(request.plant) if request.plant is not None else ():
        if effect.name == NAME and request.plant is not None:
            voltage = request.plant.parameters[at[0]].value
        else:
            told = effect.unmet or NOT_MET.get(effect.place, "nothing that a drive gives holds it")
            missed[effect.name] = OUTER if effect.place == "torque" else told
    if not voltage > 0.0:
        raise DesignError(
            "controller.feedforward of a foc meets the effect dead_time alone, and the plant has none; add "
            '[[plant.effects]] name = "dead_time", let diagnose find it, or remove the feedforward'
        )
    if given is None and resistance is None:
        raise DesignError("controller.feedforward.soft is missing; give it in A, or R_ohm, from which it follows")
    return DeadTime(voltage, given if given is not None else SOFT * voltage / (resistance or 1.0)), missed
