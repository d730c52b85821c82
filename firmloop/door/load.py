"""Load a project."""

from __future__ import annotations

import os

from firmloop.door.given import path_given
from firmloop.project.project import Project, read_project


def load(path: str | os.PathLike[str]) -> Project:
    """Read and check a project file; recordings are read later, by what needs them.

    Parameters
    ----------
    path
        the project's TOML file

    Returns
    -------
    Project
        what every other function of `firmloop` starts from

    Raises
    ------
    ProjectError
        on the first thing that is wrong, with file, line, rule and way out.
    TypeError
        when it is given no path.
    """
    return read_project(path_given("firmloop.load", path, "wheel_speed.toml"))
