"""The judge of machine code proves what the compiler made of a program, and refutes an image with a wrong constant."""

from __future__ import annotations

import random
import re
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from firmloop.cli import main
from firmloop.design.kinds import kinds
from firmloop.verify.judgement import NOT_RUN, PROVEN, REFUTED, TIMEOUT, UNKNOWN
from firmloop.verify.proofs.claims import Claims
from firmloop.verify.proofs.judge import IMAGES, Delivered
from firmloop.verify.proofs.judges import every_judge, machine_code
from firmloop.verify.proofs.machine.image import read_code
from firmloop.verify.proofs.machine.normal import ends_of
from firmloop.verify.proofs.machine.solver import EQUAL
from firmloop.verify.proofs.machine.step import step_ways
from firmloop.verify.proofs.machine.sweep import CUT, StepComparison, ranges_of
from firmloop.verify.proofs.machine.terms import Pool
from firmloop.verify.proofs.machine.values import BitTerm, applied, evaluated, reached
from tests.laws import FULL, TABLES, pid
from tests.verify.proofs.machine_code import linked, off_by_one
from tests.verify.test_tunable import PROJECT

JUDGE = every_judge()["machine_code"]
needs_packages = pytest.mark.skipif(JUDGE.version() is None, reason=f"pyvex or bitwuzla is not here: {JUDGE.install}")
FIXED = re.sub(r"tunable.*\n|\[controller.ranges\]\n(k.*\n)*", "", PROJECT).replace(
    '["host"]', '["host", "qemu_mps2_an386"]'
)
CORES = ("qemu_mps2_an385", "qemu_mps2_an386", "qemu_mps2_an500", "qemu_mps2_an505")


@pytest.fixture(scope="module")
def pi(tmp_path_factory: pytest.TempPathFactory) -> tuple[Claims, Path]:
    """Link a PI controller in fixed point for a Cortex-M4."""
    return linked(pid(TABLES["pi"]), "fixed32", "qemu_mps2_an386", tmp_path_factory.mktemp("pi"))


def delivered(claims: Claims, folder: Path, **images: bytes) -> Delivered:
    """Put images beside an empty folder of C."""
    (folder / IMAGES).mkdir()
    for name, data in images.items():
        (folder / IMAGES / f"{name}.elf").write_bytes(data)
    return Delivered(claims, folder / claims.name / "src")


def test_a_missing_package_is_named_and_nothing_is_proven(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def nothing(name: str) -> str:
        raise machine_code.PackageNotFoundError(name)

    monkeypatch.setattr(machine_code, "version", nothing)
    (tmp_path / "wheel_speed.toml").write_text(PROJECT)
    out = tmp_path / "out"
    assert main(["prove", str(tmp_path / "wheel_speed.toml"), "--out", str(out), "--judge", "machine_code"]) == 3
    said = capsys.readouterr().out
    assert "install it with: pip install 'firmloop[machine_code]'" in said and "\nproven" not in said


def test_without_an_image_it_is_not_asked_and_says_nothing(pi: tuple[Claims, Path], tmp_path: Path) -> None:
    installed, nothing = replace(JUDGE, version=lambda: "1"), delivered(pi[0], tmp_path)
    found = installed.judge(nothing)
    assert found.result == NOT_RUN and "there is no linked image" in found.says
    assert not installed.asked(nothing)


Step = tuple[str, int, tuple[int, ...], int]  # op, width, places of its arguments, data


def random_term(dice: random.Random, pool: Pool, constant: int, kept: list[Step]) -> BitTerm:
    """Make a term of a few steps, and keep what each was made of."""
    made = [pool.var(name, 32) for name in "ab"] + [pool.const(constant, 32)]
    for _ in range(8):
        at = [dice.randrange(len(made)) for _ in range(3)]
        op = dice.choice(
            [*"add sub mul and or xor shl lshr ashr eq ult ule slt sle ite concat extract zext sext not".split()]
        )
        a, b, c = (made[k] for k in at)
        width, data, places = a.width, 0, tuple(at[:2])
        if op == "ite" and a.width == 1 and b.width == c.width:
            made.append(pool.ite(a, b, c))
            width, places = b.width, tuple(at)
        elif op == "concat" and a.width + b.width <= 64:
            made.append(pool.concat(a, b))
            width = a.width + b.width
        elif op == "extract" and a.width > 1:
            data = dice.randrange(a.width)
            width, places = dice.randint(1, a.width - data), tuple(at[:1])
            made.append(pool.extract(a, data, width))
        elif op in ("zext", "sext"):
            width, places = dice.randint(a.width, 64), tuple(at[:1])
            made.append(pool.extend(op, a, width))
        elif op == "not":
            places = tuple(at[:1])
            made.append(pool.make("not", a))
        elif op not in ("ite", "concat", "extract") and a.width == b.width:
            width = 1 if op in ("eq", "ult", "ule", "slt", "sle") else a.width
            made.append(pool.make(op, a, b))
        else:
            continue
        kept.append((op, width, places, data))
    return made[-1]


@pytest.mark.parametrize("seed", range(40))
def test_a_term_that_is_simplified_has_the_same_values(seed: int) -> None:
    dice, pool = random.Random(seed), Pool()
    numbers = np.random.default_rng(seed)
    samples = {name: numbers.integers(0, 2**32, 64, np.uint64) for name in "ab"}
    samples["a"][:4] = samples["b"][:4] = [0, 1, 2**31, 2**32 - 1]
    for _ in range(20):
        kept: list[Step] = []
        constant = dice.choice([0, 1, 31, 2**32 - 1])
        term = random_term(dice, pool, constant, kept)
        values = [samples["a"], samples["b"], np.full(64, constant, np.uint64)]
        widths = [32, 32, 32]
        for op, width, places, data in kept:
            values.append(applied(op, width, [values[k] for k in places], [widths[k] for k in places], data))
            widths.append(width)
        variables = [pool.var(name, 32) for name in "ab"]
        np.testing.assert_array_equal(evaluated(reached([term, *variables]), samples)[term], values[-1])


def in_halves(pool: Pool, op: str, one: BitTerm, other: BitTerm) -> BitTerm:
    """Add or subtract words of 64 bits as a core of 32 bits does, with a carry or a borrow."""
    (a, b), (c, d) = ([pool.extract(word, low, 32) for low in (0, 32)] for word in (one, other))
    low = pool.make(op, a, c)
    carry = pool.make("ult", low, a) if op == "add" else pool.make("not", pool.make("ule", c, a))
    high = pool.make(op, pool.make(op, b, d), pool.extend("zext", carry, 32))
    return pool.concat(high, low)


@pytest.mark.parametrize("seed", range(20))
def test_a_sum_in_halves_has_the_values_of_the_sum_and_mostly_is_its_term(seed: int) -> None:
    dice, pool = random.Random(seed), Pool()
    pool.ranges["a"] = -(2**20), 2**20
    words = [pool.extend("sext", pool.var(name, bits), 64) for name, bits in (("a", 32), ("b", 32), ("c", 16))]
    whole = apart = words[0]
    takes_away = seed % 2 == 1  # what takes words away that it has added is not always written in one way
    for _ in range(4):
        kind, word = dice.choice(["add", "sub" if takes_away else "add", "shift"]), dice.choice(words)
        if kind == "shift":
            count = dice.randint(1, 4)
            whole = pool.make("shl", whole, pool.const(count, 64))
            low, high = (pool.extract(apart, at, 32) for at in (0, 32))
            moved = pool.make("lshr", low, pool.const(32 - count, 32))
            low, high = (pool.make("shl", half, pool.const(count, 32)) for half in (low, high))
            apart = pool.concat(pool.make("or", high, moved), low)
        else:
            word = pool.make("mul", word, pool.const(dice.randrange(1, 2**24), 64))
            whole, apart = pool.make(kind, whole, word), in_halves(pool, kind, apart, word)
    half = pool.const(1 << 31, 64)
    high, bit = pool.extract(apart, 32, 32), pool.make("lshr", pool.extract(apart, 0, 32), pool.const(31, 32))
    rounded = pool.make("add", high, bit), pool.extract(pool.make("add", whole, half), 32, 32)
    numbers = np.random.default_rng(seed)
    samples = {"a": numbers.integers(-(2**20), 2**20, 64) & (2**32 - 1), "b": numbers.integers(0, 2**32, 64)}
    samples["c"] = numbers.integers(0, 2**16, 64)
    values = evaluated(
        reached([whole, apart, *rounded]), {name: row.astype(np.uint64) for name, row in samples.items()}
    )
    np.testing.assert_array_equal(values[whole], values[apart])
    np.testing.assert_array_equal(values[rounded[0]], values[rounded[1]])
    assert takes_away or rounded[0] is rounded[1]


@needs_packages
def test_a_project_is_linked_and_its_machine_code_proven(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "wheel_speed.toml").write_text(FIXED)
    out = tmp_path / "out"
    status = main(["prove", str(tmp_path / "wheel_speed.toml"), "--out", str(out), "--judge", "machine_code"])
    said = capsys.readouterr().out
    assert (status, said.rstrip().splitlines()[-1]) == (0, "proven") and "on qemu_mps2_an386" in said


@needs_packages
@pytest.mark.parametrize("target", CORES)
@pytest.mark.parametrize("number", ["fixed32", "fixed16"])
def test_the_step_of_a_pid_is_proven_on_each_core(target: str, number: str, tmp_path: Path) -> None:
    claims, elf = linked(pid(FULL), number, target, tmp_path)
    assert machine_code.judge_image(claims, elf) == (PROVEN, "")


@needs_packages
def test_every_constant_that_is_wrong_by_one_unit_is_refuted(pi: tuple[Claims, Path], tmp_path: Path) -> None:
    images = list(off_by_one(*pi))
    assert len(images) >= 6
    for data in images:
        (tmp_path / "image.elf").write_bytes(data)
        result, says = machine_code.judge_image(pi[0], tmp_path / "image.elf")
        assert result == REFUTED and ", not " in says and " for in.reference = " in says


@needs_packages
def test_images_are_refused_by_name(pi: tuple[Claims, Path], tmp_path: Path) -> None:
    """Of another program; one of three that is wrong; no image at all; one for another processor."""
    claims, elf = pi
    data = elf.read_bytes()
    stale = data.replace(claims.program_id.encode(), b"0123456789abcdef")
    found = JUDGE.judge(delivered(claims, tmp_path, a=data, b=stale, c=data))
    assert (found.result, found.says) == (
        REFUTED,
        f"b: it does not run program {claims.program_id}: it is stale, or of another project; proven on a, c",
    )
    for text, says in ((b"no image", "no image for a 32-bit processor"), (data[:18] + b"\xf3" + data[19:], "another")):
        (tmp_path / IMAGES / "b.elf").write_bytes(text)
        found = JUDGE.judge(Delivered(claims, tmp_path / claims.name / "src"))
        assert found.result == UNKNOWN and says in found.says and found.says.startswith("b: ")


@needs_packages
def test_what_bounds_a_value_on_one_way_through_the_code_does_not_on_another(pi: tuple[Claims, Path]) -> None:
    claims, elf = pi
    pool = Pool()
    pool.ranges.update(ranges_of(claims))
    ways = step_ways(pool, claims, read_code(elf))
    compared, value = StepComparison(pool, claims, ways, time.monotonic() + 60.0), pool.var(f"{CUT}another", 32)
    pool.ends[value] = (0, 0)
    assert compared.prove()[0] == EQUAL
    assert ends_of(pool, value) == (-(2**31), 2**31 - 1)


@needs_packages
def test_what_is_not_decided_is_no_proof(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(machine_code, "LONGEST", 0.0)
    (request,) = kinds()["fuzzy_pid"].examples.values()
    law = kinds()["fuzzy_pid"].design(request).law
    result, says = machine_code.judge_image(*linked(law, "fixed16", "qemu_mps2_an386", tmp_path))
    assert result == TIMEOUT and "is not decided in" in says


@needs_packages
def test_a_loop_is_not_followed(tmp_path: Path) -> None:
    (request,) = kinds()["foc"].examples.values()
    claims, elf = linked(kinds()["foc"].design(request).law, "fixed32", "qemu_mps2_an386", tmp_path)
    result, says = machine_code.judge_image(claims, elf)
    assert result == UNKNOWN and says.startswith("there is a loop at 0x")
