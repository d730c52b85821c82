"""Count a public current loop beside ours on one instruction counter: that of SimpleFOC, from a checkout of it.

    git clone https://github.com/simplefoc/Arduino-FOC
    python -m bench.codegen.public_foc Arduino-FOC

Both are built at -O2 for the Cortex-M4F and called by the same image in QEMU with the same random inputs: Clarke, Park,
a PI of d and one of q, inverse Park, space vector modulation and limits of the duties. Theirs is called function by
function as its loopFOC() does for a current in the rotor's frame, without its filters, sensor and clock, and may fuse
multiplications and additions, which is its compiler's default. Ours also divides by the supply that is measured, keeps
the voltage on a circle and holds the integrals while it stands there, in every row. Exit status 1 where ours takes more
instructions than theirs for a usual step, or where the duties of both differ by more than their sine does.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from firmloop.codegen.bundle import write_files
from firmloop.codegen.emit import emit
from firmloop.codegen.firmware import LINK_FLAGS, compile_flags, firmware
from firmloop.codegen.target import Target, load_target
from firmloop.design.kinds import kinds
from firmloop.identify.simulation.compiler import run_compiler
from firmloop.quantize.lower.lower import lower
from firmloop.quantize.program import Program
from firmloop.verify.build.cost import instructions
from firmloop.verify.compare import record_type
from firmloop.verify.links.semihosting import open_semihosting
from firmloop.verify.scaling import to_physical, to_raw

TARGET = "qemu_mps2_an386"
STEPS = 4000
SUPPLY, MOST_CURRENT = 24.0, 3.0  # V, A: far from any limit, so that both compute the same
APART = 5e-3  # of a duty; the sine of theirs is a table of 16 bits, and its integral is Tustin's
GAINS = {"kp_d": 0.3, "ki_d": 540.0, "kp_q": 0.5, "ki_q": 540.0}
MACHINE = {"Ld_H": 0.2e-3, "Lq_H": 0.33e-3, "flux_Wb": 6.4e-3}  # theirs has no term with the flux
SOURCES = (
    *("common/foc_utils", "common/pid", "common/lowpass_filter", "common/time_utils", "BLDCMotor"),
    *("common/base_classes/CurrentSense", "common/base_classes/FOCMotor", "common/base_classes/Sensor"),
    "drivers/BLDCDriver3PWM",
)
COMPILER = "arm-none-eabi-g++"
FLAGS = ("-O2", "-ffreestanding", "-fbuiltin", "-fno-math-errno", "-ffunction-sections", "-fdata-sections")
PLUS = ("-std=gnu++17", "-fno-exceptions", "-fno-rtti", "-fno-threadsafe-statics", "-fno-use-cxa-atexit", "-w")
ARDUINO = r"""
#pragma once
#include <inttypes.h>
#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#define min(a, b) ((a) < (b) ? (a) : (b))
#define max(a, b) ((a) > (b) ? (a) : (b))
#define F(text) (text)
#define OUTPUT 1
#define HIGH 1
#define LOW 0
class Print {
public:
    template <class T> size_t print(T, int = 2) { return 0; }
    template <class T> size_t println(T, int = 2) { return 0; }
    size_t println() { return 0; }
};
inline unsigned long micros() { return 0; }
inline void delay(unsigned long) {}
inline void delayMicroseconds(unsigned) {}
inline void pinMode(int, int) {}
inline void digitalWrite(int, int) {}
"""
WRAPPER = r"""
#include "BLDCMotor.h"
#include "drivers/BLDCDriver3PWM.h"
#include "controller/NAME.h"

inline void *operator new(size_t, void *where) { return where; }

struct Sense : CurrentSense {
    PhaseCurrent_s seen;
    int init() override { return 1; }
    PhaseCurrent_s getPhaseCurrents() override { return seen; }
};

alignas(8) static unsigned char motor_place[sizeof(BLDCMotor)];
alignas(8) static unsigned char driver_place[sizeof(BLDCDriver3PWM)];
alignas(8) static unsigned char sense_place[sizeof(Sense)];
static BLDCMotor *motor;
static BLDCDriver3PWM *driver;
static Sense *sense;

void _writeDutyCycle3PWM(float, float, float, void *) {}
void *_configure3PWM(long, const int, const int, const int) { return nullptr; }

extern "C" {
void __cxa_pure_virtual() { for (;;) {} }

void NAME_init(NAME_t *) {
    driver = new (driver_place) BLDCDriver3PWM(1, 2, 3);
    driver->voltage_power_supply = SUPPLYf;
    driver->voltage_limit = SUPPLYf;
    motor = new (motor_place) BLDCMotor(1, NOT_SET, NOT_SET, LQf, LDf);
    motor->linkDriver(driver);
    motor->voltage_limit = SUPPLYf;
    motor->foc_modulation = FOCModulationType::SpaceVectorPWM;
    motor->PID_current_q = PIDController(KPQf, KIQf, 0.0f, NOT_SET, SUPPLYf, PERIODf);
    motor->PID_current_d = PIDController(KPDf, KIDf, 0.0f, NOT_SET, SUPPLYf, PERIODf);
    sense = new (sense_place) Sense();
    sense->driver_type = DriverType::BLDC;
}

uint32_t NAME_step(NAME_t *, const NAME_in_t *in, NAME_out_t *out) {
    sense->seen = {in->current_a_A, in->current_b_A, 0.0f};
    const float angle = in->angle_rad;
    const DQCurrent_s current = sense->getFOCCurrents(angle);
    float q = motor->PID_current_q(in->reference_q_A - current.q);
    float d = motor->PID_current_d(in->reference_d_A - current.d);
#if DECOUPLED
    const float most = motor->voltage_limit, speed = in->speed_rad_s;
    d = _constrain(d - in->reference_q_A * speed * motor->pole_pairs * motor->axis_inductance.q, -most, most);
    q = _constrain(q + current.d * speed * motor->pole_pairs * motor->axis_inductance.d, -most, most);
#endif
    motor->setPhaseVoltage(q, d, angle);
    out->duty_a = driver->dc_a;
    out->duty_b = driver->dc_b;
    out->duty_c = driver->dc_c;
    return 0U;
}
}
"""
Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Counted:
    """Instructions of a step, and the duties (steps, 3)."""

    usual: int
    most: int
    duties: Array


def program_of(arithmetic: str, decoupling: bool) -> Program:
    """Return our current loop with the gains that both get; the angle goes from 0 to a whole turn, as theirs does."""
    example = kinds()["foc"].example
    table = {**GAINS, **(MACHINE if decoupling else {}), "decoupling": decoupling, "d_share": 0.9, "tt_s": 1.0}
    inputs = tuple(replace(wire, low=0.0, high=6.2831) if wire.name == "angle_rad" else wire for wire in example.inputs)
    return lower(kinds()["foc"].design(replace(example, table=table, inputs=inputs)).law, arithmetic)


def wires_of(program: Program) -> Mapping[str, Array]:
    """Return inputs far from any limit: small errors of the currents at every angle, and the supply held."""
    random = np.random.default_rng(1)
    draw = {value.name: random.uniform(-MOST_CURRENT, MOST_CURRENT, STEPS) for value in program.inputs}
    draw["angle_rad"] = random.uniform(0.0, 6.28, STEPS)
    draw["speed_rad_s"] = random.uniform(-500.0, 500.0, STEPS)
    draw["supply_V"] = np.full(STEPS, SUPPLY)
    turn = draw["angle_rad"]
    d, q = draw["reference_d_A"], draw["reference_q_A"]
    for name, behind in (("current_a_A", 0.0), ("current_b_A", 2.0 * np.pi / 3.0)):
        draw[name] = np.cos(turn - behind) * d - np.sin(turn - behind) * q + random.normal(0.0, 0.02, STEPS)
    return draw


def counted(program: Program, elf: Path, target: Target) -> Counted:
    """Run the image over the inputs."""
    wires = wires_of(program)
    columns = [to_raw(value, wires[value.name]) for value in program.inputs]
    with open_semihosting(target, elf, program.id) as link:
        link.reset()
        answers = link.step(np.ascontiguousarray(np.stack(columns, axis=-1)).tobytes(), STEPS)
        overhead = link.hello().overhead_ticks
    got = np.frombuffer(answers, record_type(program))
    count = instructions(got["ticks"], overhead, target)
    duties = np.stack([to_physical(value, got[f"out_{value.name}"]) for value in program.outputs], axis=-1)
    return Counted(int(np.median(count)), int(count.max()), duties)


def built(program: Program, checkout: Path | None, decoupling: bool, target: Target, folder: Path) -> Path:
    """Link the image of our controller, or of theirs in its place; return the file."""
    bundle = emit(program, "firmloop generate bench.toml")
    files = dict(firmware(program, bundle, target, "semihosting"))
    if checkout is not None:
        del files[f"controller/{program.name}.c"]
    write_files(files, folder)
    objects = []
    for source in (name for name in files if name.endswith(".c")):
        run_compiler([target.compiler, *compile_flags(target), "-c", source, "-o", f"{source}.o"], folder)
        objects.append(f"{source}.o")
    if checkout is not None:
        objects += theirs(program, checkout, decoupling, target, folder)
    command = [target.compiler, *compile_flags(target), *objects, *LINK_FLAGS, "-lm", "-lc", "-lgcc", "-o", "image.elf"]
    run_compiler(command, folder)
    return folder / "image.elf"


def theirs(program: Program, checkout: Path, decoupling: bool, target: Target, folder: Path) -> list[str]:
    """Compile what is needed of the checkout, and a step that calls it as ours is called."""
    names = {"NAME": program.name, "SUPPLY": f"{SUPPLY:.1f}", "PERIOD": f"{program.period!r}"}
    names |= {key: f"{GAINS[name]!r}" for key, name in zip(("KPD", "KID", "KPQ", "KIQ"), GAINS, strict=True)}
    names |= {"LD": f"{MACHINE['Ld_H']!r}", "LQ": f"{MACHINE['Lq_H']!r}"}
    text = WRAPPER
    for key, value in names.items():
        text = text.replace(f"{key}f", f"{value}f") if key != "NAME" else text.replace(key, value)
    write_files({"theirs/Arduino.h": ARDUINO, "theirs/step.cpp": text}, folder)
    sources = [*(checkout / "src" / f"{name}.cpp" for name in SOURCES), folder / "theirs" / "step.cpp"]
    flags = [*target.flags, *FLAGS, *PLUS, f"-DDECOUPLED={int(decoupling)}", "-DSIMPLEFOC_DISABLE_DEBUG"]
    where = ["-Itheirs", f"-I{checkout / 'src'}", "-I.", "-Icontroller"]
    objects = []
    for k, source in enumerate(sources):
        run_compiler([COMPILER, *flags, *where, "-c", str(source), "-o", f"theirs/{k}.o"], folder)
        objects.append(f"theirs/{k}.o")
    return objects


def main() -> int:
    """Print a line a loop."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("checkout", type=Path, help="of github.com/simplefoc/Arduino-FOC")
    arguments = parser.parse_args()
    checkout, target, missed = arguments.checkout.resolve(), load_target(TARGET), 0
    print("decoupling  loop               usual  most  theirs/ours  duties apart")
    for decoupling in (False, True):
        found: dict[str, Counted] = {}
        for name in ("SimpleFOC", "float32", "fixed32", "fixed16"):
            public = name == "SimpleFOC"
            program = program_of("float32" if public else name, decoupling)
            with tempfile.TemporaryDirectory() as folder:
                elf = built(program, checkout if public else None, decoupling, target, Path(folder))
                found[name] = counted(program, elf, target)
            one, other = found[name], found["SimpleFOC"]
            apart = float(np.max(np.abs(one.duties[:50] - other.duties[:50])))
            ratio = other.usual / one.usual
            print(f"{decoupling!s:11} {name:18} {one.usual:5} {one.most:5} {ratio:12.2f} {apart:13.2g}", flush=True)
            missed += (ratio < 1.0) + (not decoupling and apart > APART)
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
