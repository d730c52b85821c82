"""Keep what each recording of a fleet said, so that a run that was stopped goes on where it was."""

from __future__ import annotations

from pathlib import Path

from firmloop.codegen.bundle import write_files
from firmloop.project.table import ProjectError
from firmloop.stages.fleet.member import Key, Member, member_of, member_text

FOLDER = "machines"


def kept_member(out: Path, name: str, key: Key) -> Member | None:
    """Return what is kept of a recording; None where nothing is, or of another recording, project or version."""
    try:
        member = member_of((out / FOLDER / f"{name}.json").read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError):
        return None
    return member if member is not None and member.name == name and member.key == key else None


def keep(out: Path, member: Member) -> None:
    """Write one file as a whole: whoever is killed meanwhile leaves the old one, or none.

    Raises
    ------
    ProjectError
        when it cannot be written.
    """
    try:
        write_files({f"{member.name}.json": member_text(member)}, out / FOLDER)
    except OSError as error:
        raise ProjectError(f"--out {out}: cannot be written: {error.strerror}; choose another place") from None
