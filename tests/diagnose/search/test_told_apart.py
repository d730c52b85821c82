"""Effects that were mistaken for one another, or that took another along, by the seed of their case."""

from __future__ import annotations

import pytest

from bench.diagnose.blind_cases import draw_case
from tests.conftest import Once
from tests.diagnose.cases import said_once

# Seed of a case, what is to be said of it, and what it had been mistaken for.
QUICK = (
    (180020, "explained", "end_stop", "a stop is looked for where a recorded speed leads"),
    (240033, "explained", "coulomb_friction", "a peak at rest that train does not show"),
    (350086, "explained", "input_saturation", "a limit that had begun too low"),
    (370061, "explained", "sensor_quantization", "steps of 390 levels and nothing else left"),
    (590088, "ambiguous", "load_torque sensor_offset", "a load whose start is fitted: a constant in the reading"),
)
SLOW = (
    (
        170029,
        "explained",
        "load_torque",
        "a load from the first row on is no step, and no spring that is far farther off",
    ),
    (560023, "explained", "sensor_saturation", "an offset that leads simulations away"),
    (560034, "explained", "gravity_torque sensor_offset", "an angle that sums up a sensor's offset"),
    (310000, "explained", "sensor_offset", "a current's offset at the end of a curved valley"),
    (320047, "explained", "sensor_wrap", "a current that wraps twice where the nominal plant is a tenth off"),
    (470184, "explained", "sensor_wrap", "a current that leaps over five of its ranges"),
    (470164, "ambiguous", "load_torque return_spring sensor_offset", "a load that lasts beside a slow disturbance"),
    (520100, "explained", "input_saturation sensor_lag", "an inductance that had run away beside a limit"),
    (555024, "explained", "load_step", "a motor of a tenth of its torque"),
    (555029, "explained", "sensor_quantization", "the last step of a coarse sensor"),
    (570013, "explained", "input_saturation sensor_rectified", "leaps of a reading that only folds"),
    (570146, "explained", "end_stop", "what had led to a stop, and then was nothing"),
    (790086, "explained", "sensor_quantization", "coarse steps over a way of thousands of them"),
    (660012, "explained", "sensor_quantization", "a current that shows one step and else nothing"),
    (600195, "no_mismatch", "", "the average of a slow disturbance"),
    (886034, "ambiguous", "coulomb_friction stribeck_friction", "a rise at rest that would not show"),
    (994907, "explained", "stribeck_friction", "a fall from rest whose own first fit had led elsewhere"),
    (870083, "no_mismatch", "", "a wave of a ten-millionth of the way"),
    (250070, "explained", "sensor_offset", "a constant that noise follows"),
    (230062, "unknown_physics", "", "two names for one shape"),
    (240044, "explained", "eccentric_encoder presliding_friction", "an angle that holds the error of its encoder"),
    (260033, "explained", "clock_skew sensor_offset", "one output that is missed far less"),
    (260083, "explained", "load_torque sensor_wrap", "a range that a load had bent"),
    (180006, "ambiguous", "input_delay sensor_delay sensor_lag", "a fifth of a row late, far below the noise"),
    (180039, "explained", "backlash", "a clock that a bad fit asked for"),
    (310076, "explained", "backlash", "a gap between the kinks of contacts"),
    (320004, "explained", "return_spring", "a stop at the start of the way"),
    (330003, "explained", "clock_skew", "rows past the end of the input"),
    (330008, "explained", "clock_skew", "a late clock that looked like another inertia"),
    (330072, "no_mismatch", "", "a disturbance that drifts alike in both recordings"),
    (350012, "explained", "resistance_heating", "a disturbance that looked like a load step"),
    (310063, "explained", "flexible_coupling", "a coupling whose fit had ended half way"),
    (360071, "explained", "clock_skew", "a clock that looked like another hold of the input"),
    (370086, "explained", "end_stop hardening_spring stribeck_friction", "a drag in the place of friction"),
    (350010, "explained", "dead_zone flexible_coupling input_delay", "a little beside much, that unseen outputs show"),
    (390030, "explained", "clock_skew return_spring", "a contact that never yields"),
    (390051, "explained", "presliding_friction", "a contact that yields late on its way"),
    (400045, "explained", "end_stop", "a stop that bounces: edges had been traps, and any change helps somewhere"),
    (380020, "explained", "torque_constant_saturation", "what it was held against had not ended"),
    (320024, "explained", "slew_rate_limit", "a rate that bends the cost at every row"),
    (430065, "explained", "slew_rate_limit", "a rate that no screen shows"),
    (430033, "explained", "gravity_torque", "an angle that the integral of a noisy speed has lost"),
    (420054, "no_mismatch", "", "a wave of two periods in the whole way"),
    (390099, "unknown_physics", "", "a name that unseen recordings speak against"),
    (470196, "explained", "slew_rate_limit", "a rate above all slopes from row to row, which held jumps meet"),
    (450005, "explained", "end_stop", "a place from which nobody counts"),
    (450041, "explained", "asymmetric_friction", "a load and a contact that yields at once"),
    (450079, "explained", "return_spring", "a contact that hardly yields"),
    (430078, "explained", "backlash stribeck_friction", "what is mistaken most often comes first"),
    (470127, "explained", "clock_skew", "waves that innovations count against"),
    (480008, "explained", "stribeck_friction", "the average of a slow disturbance beside friction"),
    (480035, "explained", "coulomb_friction load_dependent_friction sensor_wrap", "leaps of a current beside friction"),
    (480074, "explained", "coulomb_friction load_step sensor_delay", "friction that is alike in both directions"),
    (520042, "explained", "stribeck_friction", "a spring that pulls no more than a disturbance"),
    (520055, "explained", "gravity_torque sensor_wrap stribeck_friction", "friction that would rise with speed"),
    (520110, "explained", "coulomb_friction", "one direction's friction beside a slow disturbance"),
    (530054, "unknown_physics", "", "one direction that gains less than the other"),
    (530090, "unknown_physics", "", "a mean that a name makes up for"),
    (540081, "explained", "coulomb_friction quadratic_drag sensor_lag", "friction that would vanish with speed"),
    (520149, "explained", "backlash", "a gap between the starts of its grid"),
    (580009, "explained", "sensor_lag torque_ripple", "waves that follow an angle which is read late"),
    (590002, "explained", "clock_skew gravity_torque", "waves that follow an angle which another clock reads"),
    (
        660057,
        "ambiguous",
        "dead_zone flexible_coupling input_delay sensor_delay",
        "a delay found by what simulations miss",
    ),
    (700015, "explained", "end_stop", "what a stop does to a chirp, by simulation error"),
    (710058, "explained", "sensor_rectified", "a sign that a nominal fit had lost too"),
    (730067, "explained", "end_stop", "a stop that four effects stood for, none of them certain"),
    (710096, "explained", "sensor_rectified", "a wave that a slow disturbance makes"),
    (720032, "unknown_physics", "", "a load of which a slow disturbance leaves nothing certain"),
    (730081, "no_mismatch", "", "the largest step of a slow disturbance"),
    (680002, "explained", "backlash", "teeth that meet too late in every step"),
    (770082, "explained", "load_torque slew_rate_limit", "a load that drifts away where a slew rate is right"),
    (770130, "explained", "flexible_coupling load_step sensor_lag", "a third effect after a leap"),
    (770073, "explained", "backlash", "a gap of a ten-thousandth of the way"),
    (770012, "explained", "quadratic_drag slew_rate_limit", "a truth that was late by half a substep"),
    (770021, "ambiguous", "load_step load_torque", "a moment that a slow disturbance may have made"),
    (780124, "explained", "asymmetric_friction slew_rate_limit", "a place at rest that a speed looked like"),
    (750038, "explained", "flexible_coupling sensor_saturation", "a load of no certainty by simulation error"),
    (820079, "explained", "coulomb_friction quadratic_drag", "a friction that seems to fall with speed beside a drag"),
    (820421, "explained", "inductance_saturation sensor_wrap", "an iron that steps were too long for"),
    (830021, "explained", "backlash", "a gap of a thirtieth of the way"),
    (850024, "explained", "load_step return_spring slew_rate_limit", "innovations against the first of three"),
    (850028, "explained", "clock_skew sensor_rectified", "a sign and a clock, by what simulations miss"),
    (851225, "explained", "load_step resistance_heating sensor_lag", "a fit that ended where a simulation diverged"),
    (872126, "unknown_physics", "", "a gain of one side that drift had hidden behind a load"),
    (871088, "explained", "input_delay load_torque sensor_saturation", "an offset that led a fit out of a valley"),
    (881036, "explained", "brush_drop sensor_wrap", "a brush whose drop is nearly a range of the current"),
    (871069, "explained", "load_torque stribeck_friction", "a load and a friction while simulations stray"),
    (870034, "explained", "slew_rate_limit torque_ripple", "an angle that is turns away, and a rate of a second's way"),
    (883068, "explained", "load_torque stribeck_friction", "a friction of two sizes beside a drag"),
    (880102, "explained", "asymmetric_friction input_saturation", "a load and a friction of one size"),
    (880108, "explained", "torque_ripple", "a shaft that gathers speed between two rows"),
    (880005, "explained", "resistance_heating", "a step that may be none by its own interval"),
    (885087, "explained", "load_dependent_friction load_torque", "a torque constant that only the given one tells"),
    (887237, "explained", "hardening_spring load_step", "a step that slow pushes might have made, but not twice"),
    (887347, "explained", "load_torque sensor_wrap", "a range a little off, that a drag had soaked up"),
    (887212, "explained", "cogging_torque sensor_delay torque_ripple", "waves along an angle that is read late"),
    (885035, "unknown_physics", "", "a shape beside nothing, once the name beside it was dropped"),
    (891219, "ambiguous", "load_torque sensor_offset sensor_rectified", "a moment that is none by simulation error"),
    (893145, "explained", "load_dependent_friction load_torque", "a current of a million amperes behind iron"),
    (893238, "explained", "input_delay input_saturation", "a limit that only unseen levels of the input tell"),
    (893243, "explained", "sensor_offset slew_rate_limit", "a constant beside two slow disturbances"),
    (891157, "explained", "quadratic_drag sensor_lag", "a coupling so stiff that its load belongs to the mass"),
    (660026, "unknown_physics", "", "a shape that says four times what a name does"),
    (190031, "explained", "hardening_spring input_saturation", "what a polished simulation does without"),
)
# Of the slow ones: what a later change has lost, with what is said instead. A case that holds again has to leave here.
LOST = {
    180006: "unknown: all delays lead a simulation under a slow disturbance further off",
    370086: "a spring, a load and cogging, in whose valley a regression of the balance begins",
    390099: "dead zone or brush drop",
    480008: "dry friction: its plain simulation error does not tell the peak at rest, which the likelihood does",
    530054: "no mismatch",
    530090: "an offset or a load",
    660026: "a saturated input or an offset",
    710058: "cogging or an eccentric encoder beside it",
    750038: "cogging in place of the coupling",
    770021: "no mismatch: a moment that one disturbance may have made is none",
    850024: "unknown",
    871088: "unknown",
    872126: "a load",
}
CASES = [
    *(pytest.param(*case[:3], id=case[3]) for case in QUICK),
    *(
        pytest.param(
            *case[:3],
            id=case[3],
            marks=[pytest.mark.slow, pytest.mark.xfail(case[0] in LOST, reason=LOST.get(case[0], ""), strict=True)],
        )
        for case in SLOW
    ),
]


@pytest.mark.parametrize(("seed", "verdict", "names"), CASES)
def test_what_is_named(seed: int, verdict: str, names: str, once: Once) -> None:
    said = said_once(once, str(seed), draw_case(seed))
    assert (said["verdict"], {each["name"] for each in said["effects"]}) == (verdict, set(names.split()))
    assert verdict != "explained" or all(each["probability"] > 0.5 for each in said["effects"])
