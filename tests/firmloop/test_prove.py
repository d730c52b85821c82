"""`firmloop prove` accepts what generate wrote, and refuses by name whatever was changed behind it."""

from __future__ import annotations

import json
import re
import shutil
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from firmloop.cli import main
from firmloop.codegen.emit import emit
from firmloop.design.kinds import kinds
from firmloop.presentation.documents import as_json
from firmloop.quantize.lower.lower import lower
from firmloop.quantize.program import QuantizeError
from firmloop.quantize.proof import proof
from firmloop.verify.proofs.c_checker import check_header, check_source
from firmloop.verify.proofs.claims import ProofError
from firmloop.verify.proofs.reading import read_claims
from tests.verify.test_tunable import PROJECT


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Generate a PID with two parameters that can be tuned, in fixed point."""
    folder = tmp_path_factory.mktemp("made")
    (folder / "wheel_speed.toml").write_text(PROJECT)
    assert main(["generate", str(folder / "wheel_speed.toml"), "--out", str(folder / "out")]) == 0
    return folder / "out"


@pytest.fixture
def delivered(made: Path, tmp_path: Path) -> Path:
    """Copy what was generated, to be changed."""
    return Path(shutil.copytree(made, tmp_path / "delivered"))


def test_what_was_generated_is_proven_and_says_who_judged(made: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["prove", str(made)]) == 0
    said = capsys.readouterr().out
    assert said.rstrip().endswith("proven")
    for words in (
        "intervals 0.1.0; z3 ",
        "state words that hold anything",
        "setters of kp, ki",
        "first values",
        "wheel_speed.c: ",
        "fl_fixed.h",
        "not judged",
    ):
        assert words in said


def test_json_says_the_same(made: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["prove", str(made), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)["proof"]
    assert told["proven"] and told["refuted"] is None and len(told["judged"]) >= 7


def swap(old: str, new: str) -> Callable[[str], str]:
    """Replace the first place that a pattern finds."""

    def change(text: str) -> str:
        changed = re.sub(old, new, text, count=1)
        assert changed != text
        return changed

    return change


def one_more(match: re.Match[str]) -> str:
    return f"{match[1]}{int(match[2]) + 1}{match[3]}"


EDITS: dict[str, tuple[str, Callable[[str], str], str]] = {
    "a constant by one unit": (
        ".c",
        lambda text: re.sub(r"(fl_clamp_i32\([^,]+, -?)(\d+)(,)", one_more, text, count=1),
        "clamp",
    ),
    "a shift by one": (".c", lambda text: re.sub(r"(_i32\(.*, )(\d+)(U\))", one_more, text, count=1), "operation"),
    "an operation exchanged": (".c", swap(r"fl_max_i32", "fl_min_i32"), "max"),
    "a sign": (".c", swap(r"(const int32_t \w+ = [a-z_>0-9-]+) - ", r"\1 + "), "sub"),
    "operands exchanged": (".c", swap(r"= (\w+) - (\w+);", r"= \2 - \1;"), "sub"),
    "a line dropped": (".c", swap(r"    const int32_t .*\n", ""), "operation"),
    "a line more": (".c", swap(r"(    out->output)", r"    self->kp = 0;\n\1"), "output"),
    "a narrower type": (".c", swap(r"const int32_t", "const int16_t"), "operation"),
    "a store dropped": (".c", swap(r"    self->integral = \w+;\n", ""), "integral"),
    "a first value": (".c", swap(r"self->integral = 0;", "self->integral = 1;"), "the start of integral"),
    "a setter without its check": (".c", swap(r" && \(kp <= WHEEL_SPEED_KP_HIGH\)", ""), "the setter of kp"),
    "another status": (".c", swap(r"return \(uint32_t\).*;", "return 0U;"), "the status"),
    "a macro": (".c", swap(r"(#include \"fl_fixed.h\")", r"\1\n#define int64_t int32_t"), "# define int64_t"),
    "a comment that ends early": (".c", swap(r"; /\* ", "; /* *\\\\\n/ self->kp = 0; /* "), "backslash"),
    "a line behind the end": (".c", lambda text: f"{text}int more;\n", "in no claim"),
    "the program id": (".h", swap(r'_PROGRAM_ID "\w{4}', '_PROGRAM_ID "0000'), "program id"),
    "a wider setter": (".h", swap(r"(_KP_HIGH )(\d)", r"\g<1>9\2"), "high of parameter kp"),
    "another default": (".h", swap(r"(_KI_DEFAULT )(\d)", r"\g<1>1\2"), "default of parameter ki"),
    "another fraction": (".h", swap(r"(_OUTPUT_Q )\d+", r"\g<1>3"), "the fraction of output"),
    "members exchanged": (
        ".h",
        swap(r"int32_t kp;(.*)\n(.*)int32_t ki;", r"int32_t ki;\1\n\2int32_t kp;"),
        "the state",
    ),
}


@pytest.mark.parametrize("case", EDITS)
def test_an_edited_file_is_refused_by_name(delivered: Path, capsys: pytest.CaptureFixture[str], case: str) -> None:
    end, change, words = EDITS[case]
    path = delivered / "wheel_speed" / "src" / f"wheel_speed{end}"
    text = path.read_text()
    path.write_text(change(text))
    assert path.read_text() != text
    assert main(["prove", str(delivered)]) == 1
    said = capsys.readouterr().out
    assert "refuted: wheel_speed" in said and words in said and "\nproven" not in said


def test_layout_and_comments_are_no_edits(delivered: Path) -> None:
    path = delivered / "wheel_speed" / "src" / "wheel_speed.c"
    text = re.sub(r"/\*.*?\*/", "/* other words */", path.read_text(), flags=re.DOTALL).replace("    ", "\t")
    path.write_text(text)
    assert main(["prove", str(delivered)]) == 0


def test_support_with_other_bytes_is_refused(delivered: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = delivered / "wheel_speed" / "src" / "fl_fixed.h"
    path.write_text(path.read_text().replace("(s - 1U)", "(s - 2U)"))
    assert main(["prove", str(delivered)]) == 1
    assert "refuted: fl_fixed.h is not the file" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("line", "instead"),
    [('"fixed"\nbits = 16', '"fixed"\nbits = 32'), ('"fixed"\nbits = 16', '"float32"'), ("ki = 1.4", "ki = 1.5")],
)
def test_a_foreign_proof_is_refused(
    made: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], line: str, instead: str
) -> None:
    assert line in PROJECT
    (tmp_path / "wheel_speed.toml").write_text(PROJECT.replace(line, instead))
    assert main(["generate", str(tmp_path / "wheel_speed.toml"), "--out", str(tmp_path / "out")]) == 0
    assert main(["prove", str(tmp_path / "out")]) == 0
    shutil.copy(made / "proof.json", tmp_path / "out" / "proof.json")
    assert main(["prove", str(tmp_path / "out")]) == 1
    assert "refuted: wheel_speed.h" in capsys.readouterr().out


def test_a_stale_manifest_is_refused(delivered: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = delivered / "manifest.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | {"program_id": "0123456789abcdef"}))
    assert main(["prove", str(delivered)]) == 1
    assert "manifest.json names program 0123456789abcdef" in capsys.readouterr().out


def test_a_wrong_claim_is_refused(delivered: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = delivered / "proof.json"
    document = json.loads(path.read_text())
    document["parameters"][0]["high"] += 1
    path.write_text(json.dumps(document))
    assert main(["prove", str(delivered)]) == 1
    assert "refuted: parameter kp" in capsys.readouterr().out


@pytest.mark.parametrize(
    "text",
    [
        "",
        "{}",
        "[]",
        "null",
        "no",
        '{"schema": 9}',
        '{"schema": NaN}',
        '{"schema": 1, "schema": 1}',
        "[" * 100_000,
        "1" * 5000,
    ],
)
def test_what_is_no_proof_is_the_users_file(delivered: Path, capsys: pytest.CaptureFixture[str], text: str) -> None:
    (delivered / "proof.json").write_text(text)
    assert main(["prove", str(delivered)]) == 2
    assert "proof.json" in capsys.readouterr().err


def test_the_file_of_the_proof_stands_for_its_folder(delivered: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["prove", str(delivered / "proof.json")]) == 0
    assert "proven" in capsys.readouterr().out.splitlines()
    assert main(["prove", str(delivered / "manifest.json")]) == 2
    assert "is no project; give the folder that `firmloop generate` wrote" in capsys.readouterr().err


@pytest.mark.parametrize("name", ["proof.json", "wheel_speed.c", "wheel_speed.h", "fl_fixed.h"])
def test_a_missing_file_is_named(delivered: Path, capsys: pytest.CaptureFixture[str], name: str) -> None:
    next(delivered.rglob(name)).unlink()
    assert main(["prove", str(delivered)]) == 2
    assert f"{name}: no such file" in capsys.readouterr().err


@pytest.mark.parametrize(
    "name", ["proof.json", "manifest.json", "tuned/src/tuned.c", "tuned/src/tuned.h", "tuned/src", "tuned"]
)
def test_a_link_out_of_the_folder_is_refused(
    delivered: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str
) -> None:
    path = delivered / name.replace("tuned", json.loads((delivered / "proof.json").read_text())["name"])
    path.rename(tmp_path / "elsewhere")
    path.symlink_to(tmp_path / "elsewhere")
    assert main(["prove", str(delivered)]) == 2
    assert "is a link out of the folder" in capsys.readouterr().err


def test_without_z3_nothing_is_proven(
    made: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "z3", None)
    assert main(["prove", str(made)]) == 3
    said = capsys.readouterr().out
    assert "z3 is not installed; install it with: pip install z3-solver" in said
    assert said.rstrip().endswith("not proven: z3: not run")


@pytest.mark.parametrize("arithmetic", ["fixed32", "fixed16", "float32", "float64"])
def test_every_kind_states_what_it_proves_and_no_constant_can_change(arithmetic: str) -> None:
    """Tables and routines too: every number of the .c, changed alone, is seen."""
    edits = 0
    for kind in kinds().values():
        for request in kind.examples.values():
            law = kind.design(request).law
            try:
                program = lower(law, arithmetic)
            except QuantizeError:
                assert arithmetic.startswith("fixed")
                continue
            claims = read_claims(json.loads(as_json(proof(program, law.reasons))))
            files = emit(program, "firmloop generate x.toml").files
            source = files[f"{program.name}.c"]
            assert check_header(claims, files[f"{program.name}.h"]) and check_source(claims, source)
            plain = re.sub(r"/\*.*?\*/", "", source, flags=re.DOTALL)
            places = list(re.finditer(r"(?<![\w.])\d+(?:\.\d+)?(?![\w.])", plain))
            for place in places[:: max(1, len(places) // 8)]:
                changed = f"{plain[: place.start()]}7{plain[place.start() :]}"
                with pytest.raises(ProofError):
                    check_source(claims, changed)
                edits += 1
    assert edits > 50
