"""Units as makers print them have the value that a calculation of its own gives, or are refused with a sentence."""

from __future__ import annotations

import pytest

from firmloop.identify.bench_tests.quantity import in_si
from firmloop.identify.error import IdentifyError
from firmloop.identify.printed_units import conversion
from firmloop.identify.units import carried_unit, ending_of, unit_of

PI = 3.141592653589793
RPM = 0.10471975511965977  # rad/s, 2 pi/60
LBF, OZF = 4.4482216152605, 0.27801385095378125  # N
LB_IN, OZ_IN, LB_FT = 0.1129848290276167, 0.007061551814226043, 1.3558179483314003  # N m
KGF_CM = 0.0980665  # N m

# By wanted unit: the value of one, and every print of it.
PRINTED: dict[str, dict[float, str]] = {
    "V*s/rad": {
        1.0: "V*s/rad; V s/rad; V·s/rad; V⋅s/rad; Vs/rad; V/(rad/s); V/rad/s; "
        "V/rad·s^-1; Vs; V·s; V s; V·s·rad⁻¹; V/(rad·s⁻¹); "
        "Wb; N·m/A; Nm/A; V-s/rad; V-sec/rad; volt/(rad/sec); Volts/(radians/second)",
        1e-3: "mV*s/rad; mVs; mV·s; mV/(rad/s); mVs/rad; mV s rad^-1; V/krad/s",
        1 / RPM: "V/rpm; V/RPM; V*min; V/min^-1; V/min⁻¹; V/min-1; V/(1/min); V/(r/min); V/(rev/min); V/(U/min)",
        1e-3 / RPM: "mV/rpm; mV*min; mV·min; mV min; mVmin; mV/min^-1; "
        "mV/min⁻¹; mV/min-1; mV/(1/min); V/krpm; V/kRPM; V/Krpm; V/kmin^-1; V/kmin⁻¹; V/k min-1; "
        "V/1000 rpm; V/1000rpm; V/1000 min⁻¹; V/1000 min^-1; V/(1000 rpm); V/(1000/min); mV/r/min; mV per rpm",
        1 / (2 * PI): "V/Hz; V/(rev/s); V/(r/s)",
        180 / PI: "V/(deg/s); V/(°/s)",
    },
    "N*m/A": {
        1.0: "N*m/A; N m/A; Nm/A; N·m/A; N.m/A; N-m/A; N m A^-1; Nm A⁻¹; V*s/rad; Nm/Amp; newton-meter/amp; N·m·A⁻¹",
        1e-3: "mN*m/A; mNm/A; mN·m/A; mN m/A; mN.m/A; mN-m/A; Nmm/A; N·mm/A; Nm/kA; mNm A-1",
        1e-2: "Ncm/A; N·cm/A; cNm/A; N-cm/A",
        1e-6: "\u00b5Nm/A; \u03bcNm/A; uNm/A; uN*m/A",
        OZ_IN: "oz-in/A; oz·in/A; oz*in/A; oz.in/A; oz in/A; ozf-in/A; "
        "in-oz/A; ozin/A; OZ-IN/AMP; oz-in/Amp; ounce-inch/amp; oz-in./A",
        LB_IN: "lb-in/A; lbf·in/A; in-lb/A; lb.in/A; lbf-in/A; inlb/A",
        LB_FT: "lb-ft/A; ft-lb/A; lbf·ft/A; lbft/A",
        KGF_CM: "kgf*cm/A; kgf-cm/A; kgf·cm/A; kgfcm/A; kg-cm/A; kg·cm/A; kp·cm/A; kgcm/A",
        9.80665e-5: "gf-cm/A; gfcm/A; g-cm/A; p·cm/A; gcm/A",
        1e-3 / RPM: "mV/rpm; mV*min; V/krpm; mV/min⁻¹",
    },
    "N*m": {
        1.0: "N*m; Nm; N·m; N.m; N-m; N m; J; W*s",
        1e-3: "mNm; mN·m; mN*m; Nmm; mN m; mN.m",
        1e-2: "Ncm; N·cm; cNm",
        1e3: "kNm; kN·m",
        OZ_IN: "oz-in; ozf·in; oz.in; in-oz",
        LB_IN: "lb-in; lbf·in; in-lbf; in.lb.",
        LB_FT: "lb-ft; ft-lb; ft·lbf; ft.lbf; ft lb",
        KGF_CM: "kgf*cm; kgf·cm; kg-cm; kgf.cm; kgfcm; kp·cm",
        9.80665: "kgf*m; kgf·m; kp·m; kpm; kgm",
        1e-7: "dyn·cm; dyn-cm",
    },
    "kg*m^2": {
        1.0: "kg*m^2; kg m²; kg·m²; kg.m2; kgm2; kgm²; kg-m^2; N·m·s²; Nms²; kg m^2; kg·m**2",
        1e-7: "g*cm^2; gcm²; g·cm²; gcm2; g cm^2; g-cm²; "
        "g.cm2; 10⁻⁷ kg·m²; 10^-7 kg m²; \u00d710⁻⁷ kg·m²; x10-7 kgm2; 1e-7 kg*m^2",
        1e-4: "kg*cm^2; kgcm²; kg·cm²; kg-cm²; 10⁻⁴ kg·m²; x 10^-4 kg·m^2; 10-4 kg·m2",
        1e-6: "kg·mm²; kgmm2; 10⁻⁶ kg·m²; 10-6 kgm2; \u00d710^-6 kg·m²; g·m²·10⁻³",
        OZ_IN: "oz-in-s^2; oz-in-s²; oz-in-sec²; oz·in·s²; oz-in-sec^2; ozf·in·s²; oz-in-sec2; oz in s²; oz.in.s2",
        LB_IN: "lb-in-s^2; lb-in-s²; lb-in-sec²; lbf·in·s²; in-lb-s²",
        LB_FT: "lb-ft-s^2; lb-ft-s²; slug·ft²; ft-lb-sec²",
        0.45359237 * 0.3048**2: "lb-ft2; lb*ft^2; lb-ft²; lb·ft²; lbm·ft²; lb ft²",
        0.45359237 * 0.0254**2: "lb-in2; lb·in²; lb-in²",
        0.45359237 / 16 * 0.0254**2: "oz-in2; oz·in²; oz-in²",
        KGF_CM: "kgf·cm·s²; kgf-cm-s^2; kgf cm s²",
        9.80665e-5: "gf·cm·s²; gf-cm-s²",
    },
    "N*m*s/rad": {
        1.0: "N*m*s/rad; Nms/rad; N·m·s/rad; Nm/(rad/s); Nms; N·m·s; Nm·s; N·m/rad/s; kg·m²/s",
        1e-3: "mNms; mNm/(rad/s); mN·m·s/rad; mNms/rad",
        1 / RPM: "Nm/rpm; N·m/rpm; Nm/min^-1; Nm*min; Nm/min⁻¹",
        1e-3 / RPM: "Nm/krpm; mNm/rpm; mNm/min⁻¹; N·m/1000 rpm; mNm*min",
        OZ_IN * 1e-3 / RPM: "oz-in/krpm; oz-in/KRPM; oz·in/1000 rpm",
        LB_IN: "lb-in/(rad/s); lb-in-s/rad",
    },
    "rad/s": {
        1.0: "rad/s; rad·s⁻¹; rad s^-1; rad/sec; 1/s; s⁻¹; s-1; radians/second",
        RPM: "rpm; RPM; Rpm; r.p.m.; 1/min; min^-1; min⁻¹; "
        "min-1; /min; rev/min; r/min; U/min; tr/min; turns/min; rev/minute",
        1e3 * RPM: "krpm; kRPM; 1000 rpm",
        2 * PI: "Hz; rev/s; r/s; turns/s; rev/sec",
        PI / 180: "deg/s; °/s; degrees/second",
    },
    "rad/s/V": {
        1.0: "rad/s/V; 1/(V s); 1/(V·s); rad/(V·s); (rad/s)/V; rad·s⁻¹·V⁻¹; rad/Vs; rad/s per volt",
        RPM: "rpm/V; RPM/V; min⁻¹/V; min^-1/V; 1/(min V); 1/min/V; "
        "min-1/V; r/min/V; min⁻¹V⁻¹; rpm per volt; RPM/VOLT; rpm·V⁻¹",
        2 * PI: "Hz/V; rev/s/V",
    },
    "rad/s/N/m": {
        1.0: "rad/s/N/m; rad/(s·N·m); rad/s/Nm; (rad/s)/(N·m)",
        1e3 * RPM: "rpm/mNm; rpm/(mN*m); rpm/mN·m; min⁻¹/mNm; min^-1/mNm; min-1/mNm; 1/(min mNm); r/min/mNm",
        RPM / OZ_IN: "rpm/oz-in; rpm/(oz-in); rpm/oz·in; RPM/OZ-IN; rpm/oz.in",
        RPM / KGF_CM: "rpm/kgf·cm; rpm/(kgf*cm)",
    },
    "ohm": {
        1.0: "ohm; Ohm; OHM; \u2126; \u03a9; ohms; V/A",
        1e-3: "mohm; m\u2126; m\u03a9; mOhm",
        1e3: "k\u2126; k\u03a9; kohm; kOhm; K\u03a9",
    },
    "H": {1.0: "H; Henry; V·s/A; Ω·s", 1e-3: "mH; mHenry; mVs/A; mHy", 1e-6: "uH; \u00b5H; \u03bcH; \u00b5Henry"},
    "F": {1e-6: "uF; \u00b5F; \u03bcF", 1e-9: "nF", 1e-12: "pF"},
    "s": {
        1.0: "s; sec; seconds",
        1e-3: "ms; msec; mSec",
        1e-6: "us; \u00b5s; \u03bcs",
        60.0: "min; mins",
        3600.0: "h; hrs",
        86400.0: "day",
    },
    "W": {1.0: "W; watts; V·A; VA; Nm/s; J/s", 745.6998715822702: "hp; HP", 735.49875: "PS", 1e3: "kW"},
    "N": {1.0: "N", LBF: "lbf; lb; lbs", OZF: "ozf; oz", 9.80665: "kgf; kp; kg"},
    "K/W": {1.0: "K/W; °C/W; degC/W; C/W; K W⁻¹; ℃/W", 5 / 9: "°F/W"},
    "m^3/s": {
        1.0: "m^3/s; m³/s",
        1e-3 / 60: "l/min; liter/min; LPM",
        1e-6 / 60: "cc/min; CC/min; ml/min",
        1 / 3600: "m³/h; m3/h",
    },
    "m/s": {0.44704: "mph", 1 / 3.6: "km/h; kph"},
    "Pa": {
        133.322387415: "mmHg",
        101325.0: "atm",
        1e5: "bar",
        100.0: "hPa; mbar",
        101325.0 / 760: "Torr",
        249.08891: "inH2O; in H2O; in. w.c.; inWC; in WG; INH2O; in. of water",
        9.80665: "mmH2O; mm H\u2082O; mmAq",
        98.0665: "cmH2O",
        9806.65: "mH2O",
        2989.06692: "ftH2O",
        3386.388640341: "inHg",
    },
    "V": {1.0: "V; VDC; V DC; Vdc; V d.c.; Volts DC", 1e-3: "mV; mV DC; mVdc"},
    "A": {1.0: "A; ADC; A DC; Amps DC", 1e-3: "mA; mA DC; mADC"},
    "1": {0.01: "%; percent", 1.0: "1"},
    "Hz": {1.0: "Hz; 1/s; s⁻¹; rev/s", 1e3: "kHz; KHz", 1 / 60: "rpm; 1/min"},
    "m/s^2": {9.80665: "g", 1.0: "m/s²; m/s^2; m s⁻²"},
    "rad": {1.0: "rad", PI / 180: "deg; °; degrees", 2 * PI: "rev; turns"},
}
CASES = [
    (text, wanted, value)
    for wanted, values in PRINTED.items()
    for value, texts in values.items()
    for text in texts.split("; ")
]


def test_the_table_holds_what_ten_makers_print() -> None:
    assert len({text for text, _, _ in CASES}) >= 200


@pytest.mark.parametrize(("text", "wanted", "value"), CASES, ids=[f"{text} as {wanted}" for text, wanted, _ in CASES])
def test_a_printed_unit_has_its_value(text: str, wanted: str, value: float) -> None:
    assert in_si(f"2.5 {text}", wanted, "key") == pytest.approx(2.5 * value, rel=1e-12)


@pytest.mark.parametrize(
    ("text", "si"), [("25 °C", 25.0), ("77 °F", 25.0), ("298.15 K", 25.0), ("77 degF", 25.0), ("25 celsius", 25.0)]
)
def test_a_temperature_has_its_zero(text: str, si: float) -> None:
    assert in_si(text, "degC", "key") == pytest.approx(si, rel=1e-12)


@pytest.mark.parametrize(
    ("text", "wanted", "words"),
    [
        ("furlong", "m", "'furlong'"),
        ("mN", "N*m", "no N\\*m"),
        ("mNm", "N*m/A", "no N\\*m/A"),
        ("g*cm", "kg*m^2", "no kg\\*m\\^2"),
        ("V*s", "V", "no V"),
        ("V*min", "ohm", "no ohm"),
        ("rpm", "N*m", "no N\\*m"),
        ("m^3/s", "s", "no s"),
        ("deg/s", "s", "no s"),
        ("deg", "1", "no 1"),
        ("rad*s", "s", "no s"),
        ("", "rad/s", "no unit"),
        ("rpm//V", "rad/s/V", "unknown"),
        ("V" * 60, "V", "unknown"),
        ("[V]", "V", "unknown"),
        ("NM", "N*m", "unknown"),  # in capitals mega and milli, newton and nano are one
        ("mNm/√W", "N*m/A", "no N\\*m/A"),
        ("MA", "A", "a million"),
        ("MV/RPM", "V*s/rad", "a million"),
        ("Arms", "A", "how a value was taken"),
        ("Nm/A rms", "N*m/A", "how a value was taken"),
        ("Vpp", "V", "how a value was taken"),
        ("V_eff", "V", "how a value was taken"),
        ("VAC", "V", "how a value was taken"),
    ],
)
def test_a_unit_of_another_dimension_or_none_is_refused(text: str, wanted: str, words: str) -> None:
    with pytest.raises(IdentifyError, match=words):
        conversion(text, wanted, "key")


@pytest.mark.parametrize(
    ("name", "unit", "ending"),
    [
        ("flow_m3_s", "m^3/s", "m3_s"),
        ("rate_deg_s", "deg/s", "deg_s"),
        ("rate_V_s", "V/s", "V_s"),
        ("flux_V_s", "V*s", "V_s"),
        ("acceleration_m_s2", "m/s^2", "m_s2"),
        ("inflow_l_min", "l/min", "l_min"),
        ("stiffness_N_m_rad", "N*m/rad", "N_m_rad"),
        ("inertia_kg_m2", "kg*m^2", "kg_m2"),
        ("odd_V_A_s", "", ""),
        ("x_m_s", "m/s", "m_s"),
        ("delay_s", "s", "s"),
        ("speed_mm_s", "", ""),
        ("flow_l_s", "", ""),
        ("speed_rev_s", "", ""),
        ("encoder_counts_s", "", ""),
        ("speed_rad_per_s", "", ""),
        ("torque_mN_m", "", ""),
        ("conc_mol_m3", "", ""),
        ("dose_mmol_kg", "", ""),
        ("light_lm_m2", "", ""),
        ("flow_gal_s", "", ""),
        ("rate_frames_s", "", ""),
        ("motor_T_s", "s", "s"),
        ("level_1_m", "m", "m"),
        ("motor_L_H", "H", "H"),
        ("time_in_s", "s", "s"),
    ],
)
def test_half_an_ending_is_not_taken_for_the_whole(name: str, unit: str, ending: str) -> None:
    assert (unit_of(name), ending_of(name)) == (unit, ending)


@pytest.mark.parametrize(
    ("name", "unit"),
    [
        ("speed_mm_s", "mm/s"),
        ("flow_l_s", "l/s"),
        ("flow_ml_min", "ml/min"),
        ("speed_rev_s", "rev/s"),
        ("speed_rad_per_s", "rad/s"),
        ("torque_mN_m", "mN*m"),
        ("ke_mV_s_rad", "mV*s/rad"),
        ("gyro_dps", "dps"),
        ("slew_V_us", "V/us"),
        ("rise_A_ms", "A/ms"),
        ("t_us", "us"),
        ("voltage_V_s", "V*s"),
    ],
)
def test_a_unit_of_several_words_is_read_whole(name: str, unit: str) -> None:
    assert carried_unit(name) == unit


@pytest.mark.parametrize(
    ("text", "wanted", "value"),
    [
        ("10 600 rpm", "rad/s", 10600 * RPM),
        ("10\u202f600 min\u207b\u00b9", "rad/s", 10600 * RPM),
        ("10'600 1/min", "rad/s", 10600 * RPM),
        ("1.06\u00d710\u2074 rpm", "rad/s", 10600 * RPM),
        ("1.06x10^4 rpm", "rad/s", 10600 * RPM),
        ("1.2 \u00b7 10\u207b\u2076 kg\u00b7m\u00b2", "kg*m^2", 1.2e-6),
        ("2 V/1 000 rpm", "V*s/rad", 2e-3 / RPM),
        ("250 milliohms", "ohm", 0.25),
        ("400 microhenry", "H", 4e-4),
        ("\u22125 V", "V", -5.0),
    ],
)
def test_a_number_as_printed_is_read_whole(text: str, wanted: str, value: float) -> None:
    assert in_si(text, wanted, "key") == pytest.approx(value, rel=1e-12)


@pytest.mark.parametrize(
    ("text", "wanted"),
    [("2 1/2 ohm", "ohm"), ("2\u00b75 ohm", "ohm"), ("5 12 V", "V"), ("2 V/0 rpm", "V*s/rad"), ("10,600 rpm", "rad/s")],
)
def test_a_second_number_that_is_no_power_of_ten_is_refused(text: str, wanted: str) -> None:
    with pytest.raises(IdentifyError, match="key"):
        in_si(text, wanted, "key")


@pytest.mark.parametrize(
    "name", ["v_in", "speed_min", "gain_kp", "u_pu", "omega", "motor_voltage", "in", "A", "t", "cmd"]
)
def test_words_in_a_name_are_not_taken_for_units(name: str) -> None:
    assert carried_unit(name) == ""
