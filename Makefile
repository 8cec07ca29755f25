# One command each: `make demo` shows it, `make test` proves it. Both set up all they need in .venv.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready
DEV := $(VENV)/.dev
WORKERS ?= 2

.PHONY: demo test test-sitl check types unit wheel bench docs browser clean

demo: $(READY)
	$(BIN)/mrmission upload geofences/demo_lake.geojson --k 6 --simulate --out demo-out --overwrite

test: $(DEV) check types unit wheel

# a virtual environment in the checkout, the pinned packages, this package, warm inner loops
$(READY): pyproject.toml constraints.txt
	$(PYTHON) -c 'import sys; assert sys.version_info >= (3, 11), "Python 3.11 or newer is needed, this is " + sys.version'
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt --editable .
	$(BIN)/mrmission warm
	touch $(READY)

# what tests, checks and figures need beyond the package
$(DEV): $(READY)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check "pip>=25.1"
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt --group dev
	touch $(DEV)

check: $(DEV)
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .

types: $(DEV)
	$(BIN)/mypy

# the tests that have ArduPilot's part to them run against light boats here, or are skipped by name
unit: $(DEV)
	$(BIN)/pytest -n $(WORKERS) --engines light --doctest-modules mrmission tests

# the same tests, and those for ArduPilot alone, against ArduRover (and ArduCopter) in SITL: on PATH,
# or named by ARDUROVER (ARDUCOPTER); fails when there is no ardurover
test-sitl: $(DEV)
	$(BIN)/pytest -n $(WORKERS) --dist loadfile --engines ardupilot --timeout 900 tests

# the wheel, installed in an environment that has never seen the checkout
wheel: $(DEV)
	rm -rf build/wheel && mkdir -p build/wheel
	$(BIN)/python -m build --quiet --wheel --outdir build/wheel .
	$(PYTHON) -m venv build/wheel/venv
	build/wheel/venv/bin/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt build/wheel/*.whl
	cd build/wheel && venv/bin/python -c "from mrmission.simulate.ardupilot_models import survey_parameters as p; p('motorboat-skid'), p('rover'), p('quad')"
	cd build/wheel && venv/bin/mrmission --version && venv/bin/mrmission plan ../../geofences/demo_lake.geojson --k 2 --swath 40 --out out

bench: $(DEV)
	$(BIN)/pytest tests/benchmarks -s

docs: $(DEV)
	$(BIN)/python docs/make_figures.py
	$(BIN)/python docs/make_cli.py

# tests that look at the map need Chromium; without it they are skipped, by name
browser:
	command -v chromium || (apt-get update -qq && apt-get install -y -qq chromium)

clean:
	rm -rf $(VENV) build dist demo-out .pytest_cache .mypy_cache .ruff_cache .hypothesis
