# SPDX-License-Identifier: GPL-2.0-or-later
# One line a target: the work is in the packages. Each target sets up what it needs first (tools/setup.sh).

PY := .venv/bin/python
RUN_SETUP := @tools/setup.sh run
DEV_SETUP := @tools/setup.sh dev

.DEFAULT_GOAL := help
.PHONY: help setup run test lint format matrix soak fuzz crash bench samples docs dist wheel clean
MAKEFLAGS += --no-builtin-rules

help: ## show this list
	@awk -F ':.*## ' '/^[a-z]+:.*## / { printf "  make %-9s %s\n", $$1, $$2 }' Makefile

setup: ## make this machine ready: system packages, .venv, development tools
	$(DEV_SETUP)

run: ## watch a bus: a simulated one, or make run PORT=/dev/ttyUSB0 [ARGS="--baud 9600"]
	$(RUN_SETUP)
	@.venv/bin/dalyshark watch $(if $(PORT),'$(PORT)') $(ARGS)

test: lint ## lint, then all tests; make test ARGS="-k cells -x" picks
	@$(PY) -m pytest $(ARGS)

lint: ## style, types, import rules, Lua
	$(DEV_SETUP)
	@tools/lint.sh

format: ## rewrite Python and Lua files in the house's format
	$(DEV_SETUP)
	@tools/lint.sh --write

matrix: ## the dissector's tests in several versions of Wireshark; make matrix ARGS=trixie picks
	$(DEV_SETUP)
	@$(PY) tests/matrix/run.py $(ARGS)

soak: ## a million records, good and damaged, through both readings, in every Wireshark that is there
	$(DEV_SETUP)
	@$(PY) -m bench.soak $(ARGS)

fuzz: ## mutated packets through the dissector, in every Wireshark of make matrix; make fuzz ARGS=files: damaged files
	$(DEV_SETUP)
	@$(PY) -m bench.$(if $(filter files,$(ARGS)),hostile,fuzz) $(filter-out files,$(ARGS))

crash: ## kills, torn ends, a full disk: what is left of a capture; and how fast Wireshark's capture tool is
	$(DEV_SETUP)
	@$(PY) -m bench.crash $(ARGS)

bench: ## speed and memory, beside named peers
	$(DEV_SETUP)
	@$(PY) -m bench $(ARGS)

samples: ## make pcap_samples/ again
	$(DEV_SETUP)
	@$(PY) pcap_samples/make_samples.py
	@$(PY) pcap_samples/make_wire_samples.py

docs: ## write docs/fields.md and the outputs in docs/statistics.md again
	$(DEV_SETUP)
	@$(PY) docs/make_fields.py
	@$(PY) docs/make_statistics.py

dist: ## the dissector in one file, and a zip with the profile, in dist/
	$(DEV_SETUP)
	@$(PY) tools/make_dist.py

wheel: ## build dist/*.whl and dist/*.tar.gz
	$(DEV_SETUP)
	@$(PY) -m build --quiet --outdir dist

clean: ## remove what can be made again
	@rm -rf .venv .cache dist build .pytest_cache .ruff_cache .hypothesis .import_linter_cache
