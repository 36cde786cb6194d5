# The two commands, and what they need. `make drive` and `make test` set up whatever is missing.

PYTHON ?= python3
VENV := .venv
RUN := $(VENV)/bin/python

NATIVE := CMakeLists.txt pyproject.toml $(wildcard firmware/src/*.[ch] host/*/*_core/*.[ch]pp host/*/core/*.[ch]pp)

.PHONY: drive test setup clean

drive: build/ready
	$(RUN) host/nav_loop.py

test: build/ready
	$(RUN) -m pytest

setup: build/ready

build/ready: tools/setup $(NATIVE)
	@PYTHON=$(PYTHON) tools/setup

clean:
	rm -rf build $(VENV)
