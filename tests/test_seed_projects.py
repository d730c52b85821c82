"""The two motor studies as projects: one command each from recordings to C that agrees, and the table of controllers."""

from __future__ import annotations

import json
import re
import tomllib
from pathlib import Path

import pytest

pytest.importorskip("casadi")

from examples.maxon_re15 import bench, compare
from firmloop.cli import main
from firmloop.verify.build.image import CROSS_COMPILER

RE15 = Path(bench.__file__).parent
