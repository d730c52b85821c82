"""Hide physics in recordings and diagnose them: `python -m bench.diagnose KIND score --seed 0 --count 40 --out DIR`.

KIND is `simulated` or `nulls`. Each case is a folder named after its seed, with a project that `firmloop diagnose`
takes, its recordings, and truth.json, which says what is hidden. `write` only writes them; `score` diagnoses each
through the command line, too, and prints what came out against what is hidden.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from bench.diagnose import nulls, simulated
from bench.diagnose.blind_cases import STRATA
from bench.diagnose.scored import scored, table


def write(asked: argparse.Namespace) -> list[Path]:
    """Write the cases asked for and return their folders."""
    folders = []
    for seed in range(asked.seed, asked.seed + asked.count):
        folder = asked.out / f"{seed:06d}"
        if asked.kind == "simulated":
            simulated.write(seed, asked.stratum, asked.tests, folder)
        else:
            nulls.write(seed, folder)
        folders.append(folder)
    return folders


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("kind", choices=["simulated", "nulls"])
    parser.add_argument("verb", choices=["write", "score"])
    parser.add_argument("--seed", type=int, default=0, help="of the first case")
    parser.add_argument("--count", type=int, default=10)
    parser.add_argument("--stratum", choices=["any", *STRATA], default="any", help="of simulated cases")
    parser.add_argument("--tests", type=int, default=0, help="test recordings of each simulated case")
    parser.add_argument("--out", type=Path, required=True)
    asked = parser.parse_args()
    folders = write(asked)
    if asked.verb == "score":
        print("\n".join(table([scored(folder) for folder in folders])))


if __name__ == "__main__":
    main()
