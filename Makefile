# flexaxis: `make bench` and `make test` need only python3 (3.11 or newer) and make.
# Everything is installed into .venv in this folder; `make clean` removes it.

PYTHON ?= python3
VENV := .venv
ifeq ($(OS),Windows_NT)
BIN := $(VENV)/Scripts
else
BIN := $(VENV)/bin
endif

# Small matrices under a multi-threaded BLAS are several times slower.
export OMP_NUM_THREADS = 1
export OPENBLAS_NUM_THREADS = 1
export MKL_NUM_THREADS = 1

# One process per core. Each starts with its part of the tests in the order of the folders, so that the
# data of a module are usually made once. A process without tests left takes over tests of another.
PARALLEL := -n auto --maxprocesses=8 --dist=worksteal

.PHONY: help bench test test-slow test-browser check format docs-tables docs-speed notebooks site dist clean

help:
	@echo "make bench      simulate, inject faults, estimate, score: results/smoke/report.html"
	@echo "make test       the test suite (minutes);   make test-slow adds the long checks"
	@echo "make test-browser  the demo in Chromium, where that is installed"
	@echo "make check      ruff, formatting, type checker, architecture test"
	@echo "make docs-tables  the measured tables of the documentation (half an hour)"
	@echo "make docs-speed  those of docs/speed.md, measured on this machine (minutes)"
	@echo "make notebooks  run docs/notebooks/*.py and keep what they print and draw (minutes)"
	@echo "make site       the documentation as pages that need no network: results/site/docs/index.html"
	@echo "make dist       wheel and source archive of the last commit: dist/"
	@echo "make clean      remove .venv, results and caches"

bench: $(VENV)/.core
	$(BIN)/flexaxis run smoke -o results/smoke --overwrite

test: $(VENV)/.test
	$(BIN)/python -m pytest -q $(PARALLEL)

test-slow: $(VENV)/.test $(VENV)/.docs
	$(BIN)/python -m pytest -q $(PARALLEL) -m "slow or not slow"

test-browser: $(VENV)/.browser
	$(BIN)/python -m pytest -q $(PARALLEL) -m browser tests/browser

check: $(VENV)/.check
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/python -m pytest -q tests/test_architecture.py

format: $(VENV)/.check
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

docs-tables: $(VENV)/.test
	$(BIN)/python docs/results.py

docs-speed: $(VENV)/.test
	$(BIN)/python docs/speed.py

notebooks: $(VENV)/.test
	$(BIN)/python docs/notebooks/build.py

site: $(VENV)/.docs
	$(BIN)/sphinx-build -b html -c docs/site -d build/doctrees -W --keep-going -q . results/site

dist: $(VENV)/.test
	rm -rf build/source && mkdir -p build/source dist
	git archive HEAD | tar -x -C build/source
	cd build/source && for what in wheel sdist; do \
	  $(abspath $(BIN))/python -c "from setuptools import build_meta as b; b.build_$$what('$(abspath dist)')" >/dev/null || exit 1; done

# A stamp file records each installed set of packages; it is remade when pyproject.toml changes.
$(VENV)/.core: EXTRA :=
$(VENV)/.test: EXTRA := [test]
$(VENV)/.check: EXTRA := [check]
$(VENV)/.browser: EXTRA := [test,docs]
$(VENV)/.docs: EXTRA := [docs]
$(VENV)/.core $(VENV)/.test $(VENV)/.check $(VENV)/.browser $(VENV)/.docs: pyproject.toml | $(VENV)/pyvenv.cfg
	@echo "flexaxis: installing into $(VENV) (a minute or two the first time)"
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-compile -e ".$(EXTRA)" || \
	  { echo "flexaxis: installation failed; pip's message is above. A connection to a package index is needed once."; exit 1; }
	@touch $@

$(VENV)/pyvenv.cfg:
	@command -v $(PYTHON) >/dev/null || \
	  { echo "flexaxis: $(PYTHON) not found. Install Python 3.11 or newer, or say where it is: make PYTHON=/path/to/python3 bench"; exit 1; }
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	  { echo "flexaxis: Python 3.11 or newer is needed, $(PYTHON) is $$($(PYTHON) --version 2>&1). Another one: make PYTHON=/path/to/python3 bench"; exit 1; }
	@$(PYTHON) -c 'import venv, ensurepip' 2>/dev/null || \
	  { echo "flexaxis: this Python has no venv module (on Debian or Ubuntu: apt install python3-venv)."; exit 1; }
	@$(PYTHON) -m venv $(VENV) || { rm -rf $(VENV); exit 1; }

clean:
	rm -rf $(VENV) results build dist *.egg-info .pytest_cache .mypy_cache .ruff_cache
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
