# Verbs for users (run, test) and for those who change the code (lint types bench e2e openapi ...).
# Every verb sets up what it needs in .venv first; nothing is installed outside this folder.

VENV ?= .venv
BIN := $(VENV)/bin
ARGS ?=
export PYTHONDONTWRITEBYTECODE := # byte code is kept: without it each test process compiles everything anew
# tests beside each other: one worker more than processors, since those that start processes mostly wait
BESIDE := -n $(shell n=$$(nproc); echo $$((n < 8 ? n + 1 : 8))) --dist worksteal
# The first interpreter that is new enough. Override with `make PYTHON=/path/to/python3.12 run`.
PYTHON ?= $(shell for p in python3 python3.11 python3.12 python3.13; do \
	command -v $$p >/dev/null 2>&1 && $$p -c 'import sys; sys.exit(sys.version_info < (3, 11))' && echo $$p && break; done)
PIP := $(BIN)/python -m pip --disable-pip-version-check install --quiet --constraint constraints.txt
CHRONO ?= ../shared/chrono
CHRONO_DRIVES ?= ../shared/chrono-drives

.PHONY: other-clients run test quick lint types sanitize bench e2e image openapi clients datasets model clean

run: $(VENV)/.runtime ## the service with the shipped model on http://127.0.0.1:8000
	@exec $(BIN)/rover-twin serve $(ARGS)

test: $(VENV)/.dev ## all tests but the two that take minutes (e2e, image)
	@$(BIN)/pytest $(BESIDE) $(ARGS)

quick: $(VENV)/.dev ## the inner loop: no tests that start processes, nor slow ones
	@$(BIN)/pytest -n auto --maxprocesses 8 --dist worksteal --ignore-glob="*_contract.py" --ignore-glob="*schemathesis*.py" -m "not processes and not slow and not e2e and not image" $(ARGS)

lint: $(VENV)/.dev ## style, and the direction of imports
	@$(BIN)/ruff check .
	@$(BIN)/ruff format --check .
	@PYTHONPATH=. $(BIN)/lint-imports

types: $(VENV)/.dev ## mypy, strict
	@$(BIN)/mypy
	@$(BIN)/mypy --strict clients/python
	@$(BIN)/mypy --strict clients/omniverse

sanitize: $(VENV)/.dev ## tests of engine, FMUs and numbers under AddressSanitizer and UndefinedBehaviorSanitizer (where gcc has them)
	@PYTEST=$(BIN)/pytest sh tests/learning/drive/sanitize $(ARGS)

bench: $(VENV)/.dev ## how fast, beside its floors (some minutes); writes docs/performance.md
	@$(BIN)/python -m tests.benchmarks.serving $(ARGS)

e2e: $(VENV)/.dev ## clone this checkout, follow its README
	@$(BIN)/pytest -m e2e $(ARGS)

image: $(VENV)/.dev ## build and run both container images (needs docker or podman)
	@$(BIN)/pytest -m image $(ARGS)

other-clients: $(VENV)/.dev ## install clients of other projects (1.6 GB), run the examples of docs/clients.md with them
	@$(BIN)/python -m tests.other_clients $(ARGS)

openapi: $(VENV)/.dev ## refresh the OpenAPI document that a test compares
	@$(BIN)/rover-twin openapi > tests/contract/openapi.json

clients: $(VENV)/.dev ## generate the synchronous Python client from the asynchronous one
	@$(BIN)/python clients/python/generate_sync.py

datasets: $(VENV)/.runtime ## import those shipped datasets that the store lacks from the original Chrono output in $(CHRONO) and $(CHRONO_DRIVES)
	@import() { $(BIN)/rover-twin datasets show $$2 >/dev/null 2>&1 || $(BIN)/rover-twin datasets import $$1 --set $$2 --name $$2 --strict $$3; }; \
	for set in paper mass space; do import $(CHRONO) $$set || exit 1; done; \
	for set in long stall threshold edge; do import $(CHRONO) $$set "--step-s 0.005" || exit 1; done; \
	for set in steps drive kink; do import $(CHRONO_DRIVES) $$set "--step-s 0.005" || exit 1; done

model: $(VENV)/.runtime ## train the shipped models from the shipped datasets (some minutes) as their next versions
	@$(BIN)/rover-twin train --model viper-lunar $(addprefix --dataset ,paper mass space long stall threshold edge steps drive) \
		--architecture drive_model --threads 2 --promote champion --actor "Rover Twin" \
		--description "VIPER on lunar regolith: the drive model" $(ARGS)
	@$(BIN)/rover-twin train --model viper-lunar-paper --dataset paper --dataset mass --dataset space --test-fraction 0.125 \
		--seed 1 --epochs 200 --rows-per-epoch 40000 --threads 1 --promote champion --actor "Rover Twin" \
		--description "VIPER on lunar regolith: the paper's network over the motor prior, for comparison" $(ARGS)

clean:
	rm -rf $(VENV) .pytest_cache .mypy_cache .ruff_cache .hypothesis .import_linter_cache

$(BIN)/python:
	@test -n "$(PYTHON)" || { echo "Rover Twin needs Python 3.11 or newer: install python3 and python3-venv"; exit 1; }
	@PYTHON="$(PYTHON)" VENV="$(VENV)" sh .ci/make-venv

$(VENV)/.runtime: $(BIN)/python pyproject.toml constraints.txt hatch_build.py $(wildcard service/learning/drive/native/*.[ch] service/fmu/native/*.[ch] service/wire/native/*.[ch])
	@echo "installing Rover Twin into $(VENV) (some minutes)"
	@$(PIP) --editable .
	@touch $@

$(VENV)/.dev: $(VENV)/.runtime clients/python/pyproject.toml clients/omniverse/pyproject.toml
	@echo "installing what the tests need into $(VENV)"
	@$(PIP) --editable clients/python --editable clients/omniverse --editable '.[dev]'
	@touch $@
