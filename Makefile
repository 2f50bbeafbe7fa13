# make demo   fly a simulated drone to a picture, on this machine, with nothing else installed
# make test   run every check and test
# make docs   build the documentation site in build/site; dead links are errors
# make published   convert seven published networks and run them in perception (700 MB, minutes)
# make lock   renew the versions and hashes that an aircraft installs (needs the internet)
# make audit  ask a public database for known faults in what is installed (needs the internet)
# All set up a virtual environment in .venv first; extra words: make demo ARGS="--seed 3"

PYTHON ?= python3
CONSTRAINTS ?= constraints.txt
ARGS ?=
BIN := .venv/bin
# Python keeps what it compiled, wherever it is run: tests start hundreds of processes.
export PYTHONDONTWRITEBYTECODE :=

.PHONY: demo test seeds docs lint types imports kernels pytest setup coverage mutation published lock audit clean

demo: .venv/.stamp-sim
	$(BIN)/dfvs-demo $(ARGS)

seeds: .venv/.stamp-sim
	$(BIN)/dfvs-demo --runs 10 $(ARGS)

test: .venv/.stamp-test
	@$(MAKE) --no-print-directory --jobs=2 --output-sync lint types kernels imports docs coverage
	@$(MAKE) --no-print-directory pytest

setup: .venv/.stamp-dev

lint: .venv/.stamp-test
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: .venv/.stamp-test
	$(BIN)/mypy

imports: .venv/.stamp-test
	$(BIN)/lint-imports

# The renderer's kernels are compiled into their cache before several processes would do so at once.
kernels: .venv/.stamp-test
	@mkdir -p build
	$(BIN)/dfvs-sim goal --pose 0,0,-1.3,0 --antialias --out build/kernels.png

# Settings, command lines and faults are generated from the code. Nothing is downloaded.
docs: .venv/.stamp-test
	NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --strict --quiet

# Three workers on one thread each, some of which wait. Tests in real time follow, which mostly wait: three at a time
# (marker real_time; tests/conftest.py keeps apart those that compute), two at a time (paired), or alone (serial).
# The gate's own tests run under "coverage". On a shared machine a test may fail since others took
# its time: it is run once more, with nothing beside it, and what fails again fails the stage.
IN_PARALLEL := --cache-clear --dist loadscope --no-loadscope-reorder
AGAIN = [ $$? = 1 ] && $(BIN)/python -m pytest --last-failed --last-failed-no-failures none --maxfail 3
MARKED = $$(grep -rl --include='*.py' 'mark\.$(1)' tests/components tests/harness)

pytest: .venv/.stamp-test
ifeq ($(strip $(ARGS)),)
	OPENBLAS_NUM_THREADS=1 OMP_NUM_THREADS=1 OPENCV_FOR_THREADS_NUM=1 \
	    $(BIN)/python -m pytest -n 3 $(IN_PARALLEL) -m "not (real_time or paired or serial)" \
	    --ignore tests/unit/gate --durations=40 || { $(AGAIN); }
	$(BIN)/python -m pytest -n 3 $(IN_PARALLEL) -m "real_time and not serial" $(call MARKED,real_time) --durations=15 \
	    || { $(AGAIN); }
	$(BIN)/python -m pytest -n 2 $(IN_PARALLEL) -m paired $(call MARKED,paired) --durations=5 || { $(AGAIN); }
	$(BIN)/python -m pytest --cache-clear -m serial $(call MARKED,serial) --durations=15 || { $(AGAIN); }
else
	$(BIN)/python -m pytest $(ARGS)
endif

# Every branch of the gate's core must be taken by its own tests.
coverage: .venv/.stamp-test
	$(BIN)/python -m pytest -q tests/unit/gate --cov=dfvs_core.gate --cov-branch \
	    --cov-report=term-missing --cov-fail-under=100

# Hours: change every expression of the gate's core, one at a time, and see a test fail.
mutation: .venv/.stamp-mutation
	$(BIN)/mutmut run --max-children 1
	$(BIN)/mutmut results

# An environment of its own: torchvision and an opencv-python that does not go with the headless one.
published: .venv-published/.stamp
	.venv-published/bin/python tests/published_networks.py $(ARGS)

.venv-published/.stamp: pyproject.toml lab/pyproject.toml $(CONSTRAINTS)
	$(PYTHON) -m venv .venv-published
	.venv-published/bin/python -m pip install --quiet -c $(CONSTRAINTS) -e . -e './lab[published]'
	@touch $@

.venv/bin/python:
	@$(PYTHON) -c 'import sys; v = sys.version_info; \
	sys.exit(0 if v >= (3, 11) else "error: Python %d.%d is too old; expected 3.11 or newer; run make PYTHON=python3.12" % v[:2])'
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --upgrade pip

# The aircraft's distribution and the laboratory's, for the demo; with an extra of the first, for all else.
# All cores compile what pip would on one; libraries have files that only other versions of Python can read.
.venv/.stamp-sim: OURS = -e . -e ./lab
.venv/.stamp-%: OURS = -e '.[$*]' -e './lab[dask,export]'
.venv/.stamp-%: .venv/bin/python pyproject.toml lab/pyproject.toml $(CONSTRAINTS)
	@echo "Setting up .venv ($*); the first time takes a minute or two"
	$(BIN)/python -m pip install --quiet -c $(CONSTRAINTS) hatchling editables
	$(BIN)/python -m pip install --quiet --no-compile --no-build-isolation -c $(CONSTRAINTS) $(OURS)
	@$(BIN)/python -m compileall -qq -j 0 .venv/lib || true
	@touch $@

# Exact versions and hashes for an aircraft: base dependencies and build backend, and these with the extras that deploy/ runs.
LOCK := $(BIN)/uv pip compile --quiet --universal --python-version 3.11 --generate-hashes --no-header \
    --no-emit-index-url --no-emit-find-links --no-annotate --extra build pyproject.toml

lock: .venv/.stamp-dev
	$(LOCK) --upgrade --extra dashboard --extra metrics --extra record --extra report --extra deploy -o deploy/requirements-extras.lock
	$(LOCK) --constraints deploy/requirements-extras.lock --upgrade -o deploy/requirements.lock

audit: .venv/.stamp-test
	$(BIN)/python -m pip install --quiet pip-audit
	$(BIN)/pip-audit --skip-editable

clean:
	rm -rf .venv .venv-published .mypy_cache .ruff_cache .pytest_cache .hypothesis .import_linter_cache build/site
