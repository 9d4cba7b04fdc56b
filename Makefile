# taskschema: `make train` learns a task, `make test` runs the tests; both set the environment up first.

PYTHON ?= python3.11
VENV ?= .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed
TASK ?= lateral-lifting
SEED ?= 0

.PHONY: train test test-slow compose-test check bench pictures lock env clean help

help:            ## list the targets
	@grep -E '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:.*##/\t/' | expand -t 18

train: $(STAMP)  ## learn TASK (lateral-lifting) from scratch with SEED (0)
	$(BIN)/taskschema train $(TASK) --seed $(SEED)

test: $(STAMP)   ## run the tests (under 10 minutes on 2 cores)
	$(BIN)/pytest -m "not slow" -n 2 --dist loadfile

test-slow: $(STAMP)  ## run the long tests too
	$(BIN)/pytest

compose-test: $(STAMP)  ## the whole service in containers, where there is a Docker engine
	$(BIN)/python -m tests.compose

env:             ## write .env, the settings of docker compose, with new secrets
	@test ! -e .env || { echo ".env is there already: edit it, or move it away." >&2; exit 1; }
	umask 077 && deploy/docker/new-env.sh > .env

check: $(STAMP)  ## lint, formatting, types, known vulnerabilities
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy
	$(BIN)/python .ci/audit.py

bench: $(STAMP)  ## measure the speed and print it beside its targets
	$(BIN)/python -m bench

pictures: $(STAMP)  ## draw the films in docs/pictures again
	$(BIN)/python -m bench.pictures

lock: $(STAMP)   ## write requirements.lock, and the images' parts of it, from what is installed
	$(BIN)/pip freeze --exclude-editable | grep -v '^torch==' > requirements.lock
	$(BIN)/python deploy/docker/image_locks.py

# torch comes first and alone, so that a CPU wheel is taken where there is one; everything else, its
# dependencies included, is exactly the lock's: nothing is resolved, so nothing unwanted comes along.
$(STAMP): requirements.lock pyproject.toml
	@command -v $(PYTHON) >/dev/null || { echo "taskschema needs Python 3.11: install it, or name it with PYTHON=/path/to/python3.11" >&2; exit 1; }
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(BIN)/pip install --quiet --disable-pip-version-check torch==2.13.0
	$(BIN)/pip install --quiet --disable-pip-version-check --no-deps -r requirements.lock
	$(BIN)/pip install --quiet --disable-pip-version-check --no-deps --editable .
	touch $@

clean:           ## remove the environment and caches; runs stay
	rm -rf $(VENV) .mypy_cache .ruff_cache .pytest_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
