"""Write cases whose hidden physics is known: `python -m bench.diagnose KIND write --seed 0 --count 40 --out DIR`.

KIND is `simulated` or `nulls`. Each case is a folder named after its seed, with a project that `firmloop diagnose`
takes, its recordings, and truth.json, which says what is hidden.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from bench.diagnose import nulls, simulated
from bench.diagnose.blind_cases import STRATA


def write(asked: argparse.Namespace) -> None:
    for seed in range(asked.seed, asked.seed + asked.count):
        folder = asked.out / f"{seed:06d}"
        if asked.kind == "simulated":
            simulated.write(seed, asked.stratum, asked.tests, folder)
        else:
            nulls.write(seed, folder)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("kind", choices=["simulated", "nulls"])
    parser.add_argument("verb", choices=["write"])
    parser.add_argument("--seed", type=int, default=0, help="of the first case")
    parser.add_argument("--count", type=int, default=10)
    parser.add_argument("--stratum", choices=["any", *STRATA], default="any", help="of simulated cases")
    parser.add_argument("--tests", type=int, default=0, help="test recordings of each simulated case")
    parser.add_argument("--out", type=Path, required=True)
    write(parser.parse_args())


if __name__ == "__main__":
    main()
