"""The product's own controller, in the harness of the others."""

from __future__ import annotations

import json
from pathlib import Path

from bench.mpc.cart_pole import law_of
from bench.mpc.peers.image import Parts
from bench.mpc.peers.problem import Problem
from firmloop.codegen.bundle import write_files
from firmloop.codegen.emit import emit
from firmloop.codegen.firmware import IMAGE_FLAGS
from firmloop.quantize.lower.lower import lower

ADAPTER = """
#include "{name}.h"
static {name}_t self;
void peer_start(void) {{ {name}_init(&self); }}
int peer_step(const float *state, float *move) {{
    const {name}_in_t in = {{state[0], state[1], state[2], state[3]}};
    {name}_out_t out;
    const uint32_t status = {name}_step(&self, &in, &out);
    *move = out.force;
    return status == 0u;
}}
"""


def parts(problem: Problem, folder: Path) -> Parts:
    """Generate the controller into `folder`."""
    law = law_of(json.loads(problem.path.read_text()))
    bundle = emit(lower(law, "float32"), f"firmloop generate {law.name}.toml")
    write_files(bundle.files, folder)
    sources = tuple(folder / name for name in bundle.sources)
    return Parts(ADAPTER.format(name=law.name), sources, (folder,), IMAGE_FLAGS)
