# One place for every command. `make` alone lists them.
#
# Nothing but Python 3.11 or newer (with its venv module) is needed: each target builds what it
# uses in .venv. `make demo` installs the run-time packages only; the others add the tools.

SHELL := /bin/bash
.SHELLFLAGS := -euo pipefail -c
.DEFAULT_GOAL := help

PYTHON ?= $(shell command -v python3.11 || command -v python3.12 || command -v python3.13 || command -v python3)
VENV := .venv
BIN := $(VENV)/bin
RUNTIME := $(VENV)/.runtime-installed
TOOLS := $(VENV)/.tools-installed
PACKAGES := impactd drivers analysis
PIP := $(BIN)/python -m pip --disable-pip-version-check -qq --no-input

# How the recipes below call things; give your own on the command line, e.g. `make demo ARGS="--seed 7"`.
ARGS ?=
# Of the tests: a third of their time is waiting.
WORKERS ?= 3
# Injected faults wait as long as they compute.
FAULT_WORKERS ?= 4
# Tests side by side: helpers of helpers would only keep the simulated rigs from their time.
ONE_CORE_EACH := NUMBA_NUM_THREADS=1
LOCK ?= systemd/requirements.txt
SBOM ?= impactd.cdx.json
DEB ?= dist

.PHONY: help demo serve bench docs check test test-faults test-slow test-system test-integrations soak lint types contracts docstrings \
  units audit lock sbom deb clean

help:  ## list the targets
	@sed -n 's/^\([a-z-]*\):.*## \(.*\)/make \1\t\2/p' $(MAKEFILE_LIST) | expand -t 18

$(BIN)/python:
	@if [ -z "$(PYTHON)" ] || ! "$(PYTHON)" -c 'import sys; sys.exit(sys.version_info < (3, 11))'; then \
	  echo "impactd needs Python 3.11 or newer; found: $(or $(PYTHON),none). Name one: make PYTHON=/path/to/python3.11" >&2; exit 1; fi
	@"$(PYTHON)" -m venv $(VENV) || { rm -rf $(VENV); \
	  echo "$(PYTHON) cannot make a virtual environment; on Debian: apt install python3.11-venv" >&2; exit 1; }

$(RUNTIME): pyproject.toml | $(BIN)/python
	@echo "Installing the run-time packages into $(VENV): 550 MB, a minute or two ..."
	@$(PIP) install --no-compile --editable .  # Python compiles what the demo imports; pip would all
	@touch $@

$(TOOLS): pyproject.toml | $(BIN)/python
	@echo "Installing the run-time packages and the tools into $(VENV) ..."
	@$(PIP) install --editable '.[dev]'
	@touch $(RUNTIME) $@

demo: $(RUNTIME)  ## the main job in one go on the simulated rig (ARGS="--seed 7 --out DIR")
	@$(BIN)/impactd demo $(ARGS)

serve: $(RUNTIME)  ## the daemon on the simulated rig, http://127.0.0.1:8642
	@$(BIN)/impactd serve --config config/simulated.toml --data impactd-data $(ARGS)

bench: $(TOOLS)  ## every benchmark, each as a ratio measured in the same run
	@$(BIN)/impactd bench $(ARGS)

docs: $(TOOLS)  ## the manual as a site, warnings as errors: impactd/guides/site, served at /guides
	@$(BIN)/sphinx-build --quiet --fresh-env --write-all --fail-on-warning --keep-going \
	  --conf-dir impactd/guides --doctree-dir $(VENV)/.docs . impactd/guides/site $(ARGS)
	@echo "impactd/guides/site/impactd/guides/README.html; a running daemon serves it at /guides"

lint: $(TOOLS)
	@$(BIN)/ruff check --quiet .

types: $(TOOLS)
	@$(BIN)/mypy --no-error-summary

contracts: $(TOOLS)
	@$(BIN)/lint-imports >$(VENV)/contracts.txt || { cat $(VENV)/contracts.txt; exit 1; }

docstrings: $(TOOLS)
	@git ls-files -co --exclude-standard -- $(PACKAGES:%='%/*.py') | xargs -r $(BIN)/numpydoc lint

units:
	@systemd/check

audit: $(TOOLS)
	@$(BIN)/python tests/test_project/dependency_audit.py

check: lint types contracts docstrings units audit  ## ruff, mypy, import contracts, docstrings, systemd units, audit of the packages

test: check  ## `make check`, then the tests with warnings as errors
	@$(ONE_CORE_EACH) $(BIN)/pytest -n $(WORKERS) --dist loadfile -m "not slow and not integration" $(ARGS)

test-faults: $(TOOLS)  ## every injected fault, with its figures at the end; half an hour
	@$(BIN)/pytest -s tests/faults/load -m "not soak" $(ARGS)  # alone: its figures are times
	@$(ONE_CORE_EACH) $(BIN)/pytest -n $(FAULT_WORKERS) --dist worksteal tests/faults --ignore=tests/faults/load \
	  -m "not soak and not system" $(ARGS)

test-slow: $(TOOLS)  ## all else of tens of seconds: whole diagnoses, the guides, aborts at every seam
	@$(ONE_CORE_EACH) $(BIN)/pytest -n $(WORKERS) --dist worksteal -m "slow and not soak and not integration" --ignore=tests/faults $(ARGS)

test-integrations: $(TOOLS)  ## all with the programs of a lab, in full: samplers, brokers, catalogues, packages
	@$(PIP) install --editable '.[dev,integrations]'
	@$(BIN)/pytest -s -n 0 -m integration $(ARGS)

soak: $(TOOLS)  ## the faults whose counts take hours
	@$(BIN)/pytest -s -m soak $(ARGS)

test-system: $(TOOLS)  ## the shipped units under a real systemd, in a container; needs root
	@$(BIN)/pytest -s -m system tests/faults/system $(ARGS)

lock: $(TOOLS)  ## systemd/requirements.txt anew: what an installation gets, with hashes
	@$(BIN)/python -c 'import tomllib; print(*tomllib.load(open("pyproject.toml", "rb"))["build-system"]["requires"])' \
	  | $(BIN)/uv pip compile --quiet --universal --upgrade --generate-hashes --python-version 3.11 \
	    --no-emit-index-url --no-annotate --custom-compile-command "make lock" --output-file $(LOCK) pyproject.toml -

sbom: $(TOOLS)  ## the bill of materials of the locked packages (CycloneDX): impactd.cdx.json
	@$(BIN)/python -W ignore -m cyclonedx_py requirements --pyproject pyproject.toml --mc-type application \
	  --output-reproducible --output-format JSON --output-file $(SBOM) $(LOCK)

deb: | $(BIN)/python  ## the Debian package of this Python's minor version: dist/impactd_VERSION_ARCHITECTURE.deb
	@systemd/debian/build $(DEB) $(BIN)/python

clean:  ## remove the virtual environment and every cache
	@rm -rf $(VENV) impactd/guides/site .mypy_cache .ruff_cache .pytest_cache .import_linter_cache .hypothesis
