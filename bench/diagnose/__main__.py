"""Hide physics in recordings and diagnose them: `python -m bench.diagnose KIND score --seed 0 --count 40 --out DIR`.

KIND is `simulated`, `strangers` (which needs mujoco) or `nulls`. Each case is a folder named after its seed, with a
project that `firmloop diagnose` takes, its recordings, and truth.json, which says what is hidden. `write` only writes
them; `score` diagnoses each through the command line, too, adds a line a case to DIR/scored.jsonl, goes on where it
was stopped, and prints what came out against what is hidden; `table` only prints that, of all files given to it.
"""

from __future__ import annotations

import argparse
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from bench.diagnose import nulls, simulated, strangers
from bench.diagnose.blind_cases import STRATA
from bench.diagnose.confusion import table
from bench.diagnose.hidden import NAME
from bench.diagnose.scored import Scored, as_line, of_line, scored


def write(asked: argparse.Namespace, folder: Path) -> None:
    """Write the case of a folder, whose name is its seed, unless it is there."""
    if (folder / NAME).is_file():
        return
    seed = int(folder.name)
    if asked.kind == "simulated":
        simulated.write(seed, asked.stratum, asked.tests, folder)
    elif asked.kind == "strangers":
        strangers.write(seed, folder)
    else:
        nulls.write(seed, folder)


def score(asked: argparse.Namespace, folders: list[Path]) -> list[Scored]:
    """Write and diagnose the cases that scored.jsonl lacks; return all."""
    file = asked.out / "scored.jsonl"
    done = read([file]) if file.is_file() else []
    there = {each.case for each in done}

    def one(folder: Path) -> Scored:
        write(asked, folder)
        return scored(folder)

    with ThreadPoolExecutor(asked.jobs) as pool, file.open("a", encoding="utf-8") as stream:
        for case in pool.map(one, [folder for folder in folders if folder.name not in there]):
            stream.write(as_line(case) + "\n")
            stream.flush()
            done.append(case)
    return done


def read(files: list[Path]) -> list[Scored]:
    """Return the cases of several files, one for each kind and seed."""
    cases = [of_line(line) for file in files for line in file.read_text(encoding="utf-8").splitlines()]
    return list({(each.truth.kind, each.case): each for each in cases}.values())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("kind", choices=["simulated", "strangers", "nulls"])
    parser.add_argument("verb", choices=["write", "score", "table"])
    parser.add_argument("--seed", type=int, default=0, help="of the first case")
    parser.add_argument("--count", type=int, default=10)
    parser.add_argument("--stratum", choices=["any", *STRATA], default="any", help="of simulated cases")
    parser.add_argument("--tests", type=int, default=0, help="test recordings of each simulated case")
    parser.add_argument("--jobs", type=int, default=1, help="cases at once")
    parser.add_argument("--out", type=Path, required=True, help="folder of the cases")
    parser.add_argument("--files", type=Path, nargs="*", default=[], help="more lines for the table")
    asked = parser.parse_args()
    asked.out.mkdir(parents=True, exist_ok=True)
    folders = [asked.out / f"{seed:06d}" for seed in range(asked.seed, asked.seed + asked.count)]
    if asked.verb == "write":
        for folder in folders:
            write(asked, folder)
    else:
        file = asked.out / "scored.jsonl"
        cases = score(asked, folders) if asked.verb == "score" else read([file] if file.is_file() else [])
        print("\n".join(table([*cases, *read(asked.files)])))


if __name__ == "__main__":
    main()
