# make demo   the head without hardware
# make test   lint, types, import contracts, tests, in this order (what CI runs)
# make api    the reference from the docstrings, in out/api
PYTHON ?= python3
BIN := .venv/bin
JOBS ?= auto

.PHONY: demo test lint types contracts api lock clean

demo: .venv/ready
	$(BIN)/medusa-ctl --sim demo
	$(BIN)/medusa-ctl --sim track

test: lint types contracts
	$(BIN)/python -m pytest -q -n $(JOBS) --dist worksteal

lint: .venv/ready
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: .venv/ready
	$(BIN)/mypy

contracts: .venv/ready
	$(BIN)/lint-imports

.venv/ready: pyproject.toml requirements.lock
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "Python 3.11 or later is needed; %s is %s. Set PYTHON=python3.11." % (sys.executable, sys.version.split()[0]))'
	@$(PYTHON) -c 'import ensurepip' 2>/dev/null || { echo "python3 has no venv module: apt install python3-venv"; exit 1; }
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -r requirements.lock
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation --editable .
	@touch $@

api: .venv/ready
	$(BIN)/pdoc --docformat google --output-directory out/api medusa labmate perception sim_devices

# One lock for every Python and platform we support; needs uv (pip install uv).
lock:
	uv pip compile --universal --python-version 3.11 --extra dev pyproject.toml --output-file requirements.lock

clean:
	rm -rf .venv build dist .pytest_cache .mypy_cache .ruff_cache .import_linter_cache .hypothesis
