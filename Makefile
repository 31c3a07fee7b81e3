# Everything is set up by the targets themselves: needs only Python 3.11+ (with venv) and make.

EXTRAS ?=
UV_VERSION := 0.13.8

VENV := .venv
BIN := $(VENV)/bin
empty :=
space := $(empty) $(empty)
comma := ,
ALL_EXTRAS := $(subst $(space),$(comma),$(strip test $(subst $(comma),$(space),$(EXTRAS))))
INSTALLED := $(VENV)/installed-$(subst $(comma),-,$(ALL_EXTRAS))

# The first Python on the path that is new enough.
PYTHON ?= $(shell for p in python3 python3.13 python3.12 python3.11 python; do \
	$$p -c 'import sys; sys.exit(sys.version_info < (3, 11))' >/dev/null 2>&1 && echo $$p && break; done)

.PHONY: help install render test test-browser lock clean

help:
	@echo "make install       .venv with Grimaldi and its tests' needs (EXTRAS=name,name for more)"
	@echo "make render        the creature with diffraction and by rays, into out/"
	@echo "make test          ruff, pyright and pytest"
	@echo "make test-browser  the tests that need a browser (none yet)"
	@echo "make lock          requirements.lock from pyproject.toml (LOCK_FLAGS=--upgrade for newer versions)"
	@echo "make clean         remove .venv, out and caches"

install: $(INSTALLED)

$(BIN)/uv: Makefile
	@test -n "$(PYTHON)" || { echo "grimaldi: no Python 3.11 or newer found: install one, or say make PYTHON=/path/to/python3" >&2; exit 1; }
	@$(PYTHON) -c 'import venv, ensurepip' 2>/dev/null || { \
		echo "grimaldi: $(PYTHON) has no venv: on Debian and Ubuntu run 'apt install python3-venv', then make again" >&2; exit 1; }
	@test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check uv==$(UV_VERSION)
	@touch $@

# The lock pins and hashes every extra; as a constraint it installs only those asked for.
# Compiled here, where pip does it too: else each process compiles a second's worth of imports wherever it may not write.
$(INSTALLED): $(BIN)/uv pyproject.toml requirements.lock src/grimaldi_libllvm.pth
	VIRTUAL_ENV=$(VENV) $(BIN)/uv pip install --quiet --compile-bytecode --constraint requirements.lock --editable ".[$(ALL_EXTRAS)]"
	@touch $@

# One lock for every platform and Python; no addresses in it, so that any mirror serves.
lock: $(BIN)/uv
	$(BIN)/uv pip compile --quiet --universal --python-version 3.11 --generate-hashes --all-extras \
		--no-emit-index-url --no-emit-find-links --no-annotate --custom-compile-command "make lock" \
		--output-file requirements.lock $(LOCK_FLAGS) pyproject.toml

render: install
	@mkdir -p out
	$(BIN)/grimaldi render creature -o out/creature.exr -o out/creature.png
	$(BIN)/grimaldi render creature --diffraction none -o out/creature-rays.png

test: install
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/basedpyright
	$(BIN)/python -m pytest

test-browser:
	@echo "test-browser: nothing here needs a browser yet"

clean:
	rm -rf $(VENV) out .pytest_cache .ruff_cache .hypothesis
