# Two commands matter: `make demo` and `make test`. Each sets up all it needs and is quick the second time.
# Needed beforehand: Python >= 3.11 with pip and venv, and make. Nothing else.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed
ARGS ?=

.PHONY: demo test lint fuzz setup clean

demo: setup ## a simulated quadrotor finds a moving pad, lands on it and disarms
	@$(BIN)/companion demo $(ARGS)

test: setup ## the whole test suite
	@.ci/system-packages
	@.ci/mavproxy $(PYTHON)
	@echo "-- tests"
	@OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest -q -n 2 --dist loadfile $(ARGS)

lint: setup ## style and types
	@echo "-- lint" && $(BIN)/ruff check . && $(BIN)/ruff format --check . && echo "-- types" && $(BIN)/mypy

SECONDS_EACH ?= 60
SEED ?= 1

fuzz: setup ## damaged input for the MAVLink session, the log reader and the configuration, a minute each, side by side
	@echo "-- fuzz, $(SECONDS_EACH) s each, seed $(SEED)"
	@status=0; pids=; for target in session tlog config; do \
	  OMP_NUM_THREADS=1 $(BIN)/python tests/fuzz/fuzz.py $$target --seconds $(SECONDS_EACH) --seed $(SEED) & pids="$$pids $$!"; \
	done; for pid in $$pids; do wait $$pid || status=1; done; exit $$status

setup: $(STAMP)

$(STAMP): pyproject.toml
	@echo "-- virtual environment in $(VENV) (once)"
	@test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	@echo "-- dependencies (once, about a minute)"
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check -e '.[dev]'
	@echo "-- compiling (once)"
	@PYTHONDONTWRITEBYTECODE= $(BIN)/python -m compileall -q $(VENV)/lib companion sitl_stub >/dev/null 2>&1 || true
	@touch $(STAMP)


clean:
	rm -rf $(VENV) .venv-mavproxy runs .pytest_cache .mypy_cache .ruff_cache
