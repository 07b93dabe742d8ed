# Needs Python 3.11 or newer, make and the package index; everything else goes into .venv.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin

# Matrices are small: threads of the linear algebra library cost more than they save.
export OPENBLAS_NUM_THREADS ?= 1
# Commands that start Python often must not compile all modules each time.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: demo view test test-all check results clean

demo: $(VENV)/run.stamp  ## a simulated arm is touched, the service says where
	$(BIN)/contactsense demo

view: $(VENV)/view.stamp  ## the same, shown in a browser
	$(BIN)/contactsense demo --view

MARKS ?= not slow
test: $(VENV)/test.stamp  ## the default tests, or those with other MARKS
	$(BIN)/python -m pytest -m "$(MARKS)" -n auto --dist loadgroup --no-loadscope-reorder

test-all: $(VENV)/test.stamp  ## all tests; those that measure in real time run alone
	$(BIN)/python -m pytest -m "not realtime" -n auto --dist loadgroup --no-loadscope-reorder
	$(BIN)/python -m pytest -m realtime

check: $(VENV)/test.stamp  ## style, types, import contract
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports

clean:  ## remove the environment and all caches
	rm -rf $(VENV) build *.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

$(VENV)/run.stamp: pyproject.toml constraints.txt
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "contactsense needs Python 3.11 or newer")'
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet -c constraints.txt -e .
	touch $@

$(VENV)/view.stamp: $(VENV)/run.stamp
	$(BIN)/python -m pip install --quiet -c constraints.txt -e ".[geometry,viewer]"
	touch $@

$(VENV)/test.stamp: $(VENV)/run.stamp
	$(BIN)/python -m pip install --quiet -c constraints.txt -e ".[geometry,viewer,mcap,notebook,fleet,truth,test,check]"
	touch $@

results: $(VENV)/test.stamp  ## measure everything again and write docs/results.md and docs/further_results.md
	PATH="$(CURDIR)/$(BIN):$$PATH" $(BIN)/python -m contactsense.benchmarks.results
