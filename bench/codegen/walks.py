"""Take the kinds that the motor studies compare through the command line, in every format, on the host and the M4F.

    python -m bench.codegen.walks         2*10^5 steps on the host, 2*10^4 on the M4F; `--quick` takes a tenth

Each project is written as a user would write it, `firmloop generate` and `firmloop verify` run on it, and what is shown
is read from the files they leave. In fixed point every operation of proof.json is proven a second time with z3. Exit
status 1 when anything differs, is refused or is not proven.
"""

from __future__ import annotations

import io
import itertools
import json
import math
import sys
import tempfile
import time
from collections.abc import Mapping
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Any

from firmloop.cli import main as firmloop
from firmloop.design.design import Request
from firmloop.design.kinds import kinds
from firmloop.verify.proofs.checker import check_proof

KINDS = ("fuzzy_pid", "sliding_mode", "self_tuning", "sensorless_speed", "gain_schedule", "start_monitor")
FORMATS = {
    "float32": 'number = "float32"',
    "float64": 'number = "float64"',
    "fixed32": 'number = "fixed"\nbits = 32',
    "fixed16": 'number = "fixed"\nbits = 16',
}
STEPS = {"host": 200_000, "qemu_mps2_an386": 20_000}


def project(kind: str, request: Request, arithmetic: str) -> str:
    """Return the project file of a kind's example."""
    lines = ["schema = 1", f'name = "{request.name}"', "[controller]", f'kind = "{kind}"']
    lines += [f"period_s = {request.period}", f"outputs = {json.dumps([wire.name for wire in request.outputs])}"]
    lines += [f"{key} = {toml(value)}" for key, value in request.table.items()]
    lines.append("[signals]")
    for wire in (*request.inputs, *request.outputs):
        lines.append(f'{wire.name} = {{ unit = "{wire.unit}", low = {wire.low}, high = {wire.high} }}')
    return "\n".join(
        [*lines, "[arithmetic]", FORMATS[arithmetic], "[target]", f"names = {json.dumps(list(STEPS))}", ""]
    )


def toml(value: object) -> str:
    """Write a value as TOML, tables within their line."""
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{key} = {toml(inner)}" for key, inner in value.items()) + " }"
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(toml, value))}]"
    return json.dumps(value)


def walk(kind: str, arithmetic: str, target: str, steps: int, folder: Path) -> tuple[Mapping[str, Any], str]:
    """Generate and verify; return the verdict, and what was said where there is none."""
    file = folder / f"{kind}.toml"
    file.write_text(project(kind, kinds()[kind].example, arithmetic), encoding="utf-8")
    said = io.StringIO()
    with redirect_stdout(said), redirect_stderr(said):
        status = firmloop(["generate", str(file), "--out", str(folder / "code")])
        asked = ["--target", target, "--steps", str(steps), "--out", str(folder / "proof")]
        status = status or firmloop(["verify", str(file), *asked])
    if status > 1:
        return {}, said.getvalue().strip().splitlines()[-1]
    verdict = json.loads((folder / "proof" / "verdict.json").read_text(encoding="utf-8"))
    manifest = json.loads((folder / "code" / "manifest.json").read_text(encoding="utf-8"))
    assert manifest["program_id"] == verdict["program_id"], "both verbs make the same program"
    assert isinstance(verdict, dict)
    proof = json.loads((folder / "code" / "proof.json").read_text(encoding="utf-8"))
    return {**verdict, "operations": len(proof["operations"]), "proven": proven(proof)}, said.getvalue()


def proven(proof: Mapping[str, Any]) -> int:
    """Return how many of the operations are proven; a ProofError names the first that z3 refutes in fixed point."""
    check_proof(proof)
    ends = [(one["low"], one["high"]) for one in proof["operations"]]
    held = all(one["low"] is not None and one["high"] is not None and one["why"] for one in proof["state"])
    bounded = all(one["bound"] is not None for one in proof["rounding"])
    return sum(None not in pair for pair in ends) if held and bounded else 0


def main() -> int:
    """Print one line per kind, format and target."""
    share = 10 if "--quick" in sys.argv else 1
    print(
        "kind              format    target               steps  diff   proven bound/worst instructions   text  wall s"
    )
    wrong = 0
    for kind, arithmetic, (target, steps) in itertools.product(KINDS, FORMATS, STEPS.items()):
        begun = time.perf_counter()
        with tempfile.TemporaryDirectory() as folder:
            verdict, said = walk(kind, arithmetic, target, steps // share, Path(folder))
        if not verdict:
            print(f"{kind:17} {arithmetic:9} {target:16} refused: {said}", flush=True)
            wrong += 1
            continue
        ratios = [one["bound"] / one["worst"] for one in verdict["rounding"].values() if one["worst"]]
        cost = {key: "-" if value is None else value for key, value in verdict["cost"].items()}
        counts = "-".join(dict.fromkeys(str(cost[f"instructions_{end}"]) for end in ("min", "max")))
        shown = f"{verdict['proven']} of {verdict['operations']}"
        print(
            f"{kind:17} {arithmetic:9} {target:16} {verdict['steps']:>9,} {verdict['differences']:>5} {shown:>8} "
            f"{min(ratios, default=math.nan):>11.3g} {counts:>12} {cost['text_bytes']:>6} "
            f"{time.perf_counter() - begun:>7.1f}",
            flush=True,
        )
        wrong += (
            verdict["differences"] + verdict["operations"] - verdict["proven"] + sum(ratio < 1.0 for ratio in ratios)
        )
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
