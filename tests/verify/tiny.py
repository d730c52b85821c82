"""A controller small enough to follow by hand: out = held + gain * in, held += in, over float or int32."""

from __future__ import annotations

from firmloop.codegen.bundle import Bundle
from firmloop.quantize.program import Assign, Number, Op, Program, Rounding, Value

FLOAT = Number("float", 32, 0)

HEADER = """\
#ifndef TINY_H
#define TINY_H
#include <stdint.h>
#define TINY_PROGRAM_ID "{program_id}"
typedef struct {{ float a; float b; }} tiny_in_t;
typedef struct {{ float sum; }} tiny_out_t;
typedef struct {{ float total; }} tiny_t;
void tiny_init(tiny_t *self);
uint32_t tiny_step(tiny_t *self, const tiny_in_t *in, tiny_out_t *out);
#endif
"""

SOURCE = """\
#include "tiny.h"
void tiny_init(tiny_t *self) {{ self->total = 0.0F; }}
uint32_t tiny_step(tiny_t *self, const tiny_in_t *in, tiny_out_t *out) {{
    self->total = self->total + in->a;
    out->sum = self->total + {gain} * in->b;
    return (in->b > 1.0F) ? 1U : 0U;
}}
"""


def _value(name: str) -> Value:
    return Value(name, "V", FLOAT, -10.0, 10.0)


def tiny_program(gain: float) -> Program:
    return Program(
        name="tiny",
        says="running sum",
        period=0.001,
        arithmetic="float32",
        inputs=(_value("a"), _value("b")),
        outputs=(_value("sum"),),
        state=(_value("total"),),
        start=(0.0,),
        body=(Op(_value("scaled"), "multiply", ("in.b", gain)),),
        next_state=(Assign("total", "total"),),
        results=(Assign("sum", "scaled"),),
        status=(),
        rounding=(Rounding("sum", 0.0, "V"),),
    )


def tiny_bundle(program: Program, source: str) -> Bundle:
    files = {"tiny.h": HEADER.format(program_id=program.id), "tiny.c": source}
    return Bundle("tiny", program.id, files, ("tiny.c",), ("tiny.h",))


def tiny(gain: float) -> tuple[Program, Bundle]:
    program = tiny_program(gain)
    return program, tiny_bundle(program, SOURCE.format(gain=f"{gain!r}F"))
