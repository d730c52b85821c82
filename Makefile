# The commands a developer or a visitor needs; scripts/setup makes everything they stand on.

PYTHON ?= python3
# The tests start some hundred interpreters: without bytecode each of them compiles every module anew.
unexport PYTHONDONTWRITEBYTECODE
# On one processor the types take a minute, while the others have nothing to do.
export MYPY_NUM_WORKERS := auto

.PHONY: setup demo test lint format

setup:
	@PYTHON=$(PYTHON) scripts/setup

# The whole walk on the example: recording -> plant -> controller -> C -> host and Cortex-M4F -> report.
demo: setup
	.venv/bin/firmloop run examples/wheel_speed/wheel_speed.toml --out out/wheel_speed

test: lint
	.venv/bin/python -m pytest -q -m "not slow" -n auto --dist worksteal

lint: setup
	.venv/bin/ruff check .
	.venv/bin/mypy

format: setup
	.venv/bin/ruff format .
	.venv/bin/ruff check --fix .
