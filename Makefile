# `make help` lists the commands. Everything is installed into .venv; ENV=folder moves it.
SHELL := /bin/sh
ENV ?= .venv
PORT ?=
STUDY ?= sakai2021
BIN := $(ENV)/bin
# The first Python that is new enough; PYTHON=... names another.
PYTHON ?= $(shell for name in python3 python3.14 python3.13 python3.12 python3.11; do \
	$$name -c 'import sys; sys.exit(not (3, 11) <= sys.version_info < (3, 15))' 2>/dev/null && echo $$name && break; done)

# 8000, or the next port that is free.
FREE_PORT := import socket; free = lambda port: socket.socket().connect_ex(("127.0.0.1", port)) != 0; \
	print(next(filter(free, range(8000, 8100)), 8000))

.DEFAULT_GOAL := help
.PHONY: help run test test-postgres check format bench soak evidence mutants golden check-deploy sbom lock install install-browser install-postgres clean

help:  ## List the commands
	@awk -F ':.*## ' '/^[a-z-]+:.*## / { printf "make %-8s %s\n", $$1, $$2 }' $(MAKEFILE_LIST)

run: install  ## Build the study, make an account and serve, as a test run; PORT=8000 sets the port
	@$(BIN)/xar build $(STUDY)
	@$(BIN)/xar admin create researcher --role admin --generate-password --if-missing
	@$(BIN)/xar serve --study $(STUDY) --port $(or $(PORT),$$($(BIN)/python -c '$(FREE_PORT)'))

test: install install-browser install-postgres  ## Run every test, those in the browser included
	$(BIN)/pytest -n 3 --dist loadfile

test-postgres: install install-postgres  ## Run the tests of storage and pages with PostgreSQL
	XAR_TEST_POSTGRES=1 $(BIN)/pytest -n 2 --dist loadfile tests/unit/storage tests/web

check: install  ## Style, types, import arrows, dependencies, security
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/deptry .
	$(BIN)/bandit --quiet --recursive -ll --configfile pyproject.toml webapp .ci

format: install  ## Format the Python files and mend what can be mended
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

bench: install  ## Time what the documentation promises
	@status=0; for part in promises exact_importance batched_sampling reachability scale pictures pages dashboard dashboard_pages exports abuse sign_in group_commit ordinal analysis power rehearsal learning_runs sweeps; do \
		echo "== $$part"; $(BIN)/python -m tests.benchmarks.$$part || status=1; done; exit $$status

soak: install install-browser install-postgres  ## Many at once, every way of taking part, every fault in full; hours; fills docs/evidence.md
	$(BIN)/python -m tests.benchmarks.soak
	$(BIN)/python -m tests.benchmarks.every_way
	$(BIN)/python -m tests.faults.spreadsheets --full
	status=0; $(BIN)/python -m tests.evidence.record || status=1; $(BIN)/python -m tests.evidence; exit $$status

mutants: install  ## Change the program on purpose and see whether tests notice; writes docs/mutants.md
	$(BIN)/python -m tests.faults.mutation

golden: install  ## Compute the analysis's golden numbers anew where R is installed, and compare
	$(BIN)/python -m tests.golden.analysis.recompute

check-deploy: install install-browser  ## The files of deploy/, by the tools that know them
	$(BIN)/pytest -q tests/unit/test_deployment.py tests/unit/test_deployed_images.py

sbom: install  ## Write docs/sbom.cdx.json: the locked packages that the program needs
	$(BIN)/python .ci/sbom.py

lock: install  ## Compile constraints.txt anew from pyproject.toml, and what the images hold
	$(BIN)/uv pip compile --quiet --upgrade --python-version 3.11 --extra test --extra dev --extra dask \
		--output-file constraints.txt pyproject.toml
	$(BIN)/uv pip compile --quiet --python-version 3.11 --constraints constraints.txt \
		--output-file deploy/requirements.txt pyproject.toml
	echo hatchling | $(BIN)/uv pip compile --quiet --python-version 3.11 --constraints constraints.txt \
		--output-file deploy/requirements-wheel.txt -

evidence:  ## Write docs/evidence.md from results/evidence, which `make soak` fills
	$(BIN)/python -m tests.evidence

clean:  ## Remove caches and the environment; databases, secrets and bundles in instance/ stay
	rm -rf $(ENV) build dist .pytest_cache .mypy_cache .ruff_cache .import_linter_cache .hypothesis test-results
	find . -name __pycache__ -type d -not -path './$(ENV)/*' -prune -exec rm -rf {} +

install:
	@test -n "$(PYTHON)" || { echo "Python 3.11 to 3.14 is needed and none was found; PYTHON=... names one." >&2; exit 2; }
	@$(PYTHON) .ci/install.py --environment $(ENV)

install-postgres: install
	@$(PYTHON) .ci/install.py --environment $(ENV) --postgres

install-browser: install
	@$(PYTHON) .ci/install.py --environment $(ENV) --browser --spreadsheet
