# `make demo` and `make test` are all a new machine needs: they create the environment they use.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check install --quiet -c constraints.txt

.PHONY: demo test test-fast test-all check bench docs clean

demo: $(VENV)/.run
	$(BIN)/starhold compare three-laws -o demo --force

# The linters, of which one takes as long as a third of the tests, run beside them.
test: $(VENV)/.test
	@$(MAKE) --no-print-directory check > $(VENV)/check.log 2>&1 & check=$$!; \
	$(BIN)/python -m pytest --workers 2; tests=$$?; \
	wait $$check; check=$$?; cat $(VENV)/check.log; exit $$((tests + check))

# A part of the tests for the time between two changes: under a minute.
test-fast: $(VENV)/.test
	$(BIN)/python -m pytest --workers 2 -q tests/algebra tests/analysis tests/loop tests/parts tests/synthesis tests/scenario --ignore tests/parts/test_wheels.py --ignore tests/parts/test_one_file.py --ignore tests/parts/test_bounds_attacked.py --ignore tests/parts/test_watching_estimators.py --ignore tests/parts/test_parts_against_oracles.py

test-all: check
	STARHOLD_TESTS=whole $(BIN)/python -m pytest --workers 2 -m ""

check: $(VENV)/.test
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/pyright --pythonpath $(BIN)/python
	$(BIN)/lint-imports

bench: $(VENV)/.bench
	$(BIN)/python benchmarks/run_all.py

docs: $(VENV)/.docs
	$(BIN)/python docs/generate.py
	$(BIN)/mkdocs build --strict

# One installation for each purpose; Python compiles what is imported, a small part of what is installed. The pip that comes
# with Python may be years old, and takes twice as long as a new one.
$(VENV)/.run $(VENV)/.test $(VENV)/.bench $(VENV)/.docs: $(VENV)/.%: pyproject.toml constraints.txt
	test -x $(BIN)/python || { $(PYTHON) -m venv $(VENV) && $(PIP) --no-compile --upgrade pip; }
	$(PIP) --no-compile -e .$(if $(filter run,$*),,[$*])
	touch $@

clean:
	rm -rf $(VENV) demo results build dist site
