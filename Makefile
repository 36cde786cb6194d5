# The two commands, and what they need. `make drive` and `make test` set up whatever is missing.

PYTHON ?= python3
VENV := .venv
RUN := $(VENV)/bin/python

NATIVE := CMakeLists.txt pyproject.toml $(wildcard firmware/src/*.[ch] host/*/*_core/*.[ch]pp host/*/core/*.[ch]pp)

.PHONY: drive test setup firmware budget avr clean

drive: build/ready
	$(RUN) host/nav_loop.py

test: build/ready
	$(RUN) -m pytest

setup: build/ready

build/ready: tools/setup $(NATIVE)
	@PYTHON=$(PYTHON) tools/setup

# The ATmega's program, and the simulator that runs it: both need tools/setup_avr once.
firmware:
	$(PYTHON) tools/build_firmware.py

budget: firmware
	$(PYTHON) tools/firmware_budget.py

avr: firmware
	$(PYTHON) tools/build_rig.py

clean:
	rm -rf build $(VENV)
