# `make report` and `make test` work on a machine with nothing but Python 3.11+ and make.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed

.PHONY: report stability test lint lab bench clean

report: $(STAMP)
	$(BIN)/mrac report --out reports/nominal
	$(BIN)/mrac paper --out reports/paper

stability: $(STAMP)
	$(BIN)/mrac stability --out reports/stability

test: $(STAMP)
	$(BIN)/python -m pytest

lint: $(STAMP)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

lab: $(STAMP)
	$(BIN)/jupytext --to ipynb --update notebooks/*.py
	$(BIN)/jupyter lab notebooks

# The peers that are compared with; what does not install is left out of the comparison.
bench: $(STAMP)
	-$(BIN)/python -m pip install --quiet --require-hashes --requirement benchmarks/requirements.lock
	$(BIN)/python -m benchmarks

clean:
	rm -rf $(VENV) reports/*/

# The lock pins every package with its hashes; the project itself goes in without dependencies.
$(STAMP): requirements.lock pyproject.toml
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "Python 3.11 or newer is needed, this is " + sys.version)'
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --require-hashes --requirement requirements.lock
	$(BIN)/python -m pip install --quiet --no-deps --no-build-isolation --editable .
	touch $(STAMP)
