# Two commands for a newcomer: `make demo` and `make test`. Both make their own environment once.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready
LANDMARKS := $(VENV)/.landmarks

.PHONY: demo test test-slow lint clean

demo: $(READY)
	$(BIN)/facesynth demo

test: $(LANDMARKS) lint
	$(BIN)/python -m pytest -n 2 --dist loadgroup -rs -m "not slow"

test-slow: $(LANDMARKS)
	$(BIN)/python -m pytest -n 2 --dist loadgroup -rs -m slow

lint: $(READY)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

$(READY): pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade pip
	$(BIN)/python -m pip install --quiet --editable ".[demo,dev]"
	@touch $(READY)

# The networks that find faces; without a network their tests are skipped, and say so.
$(LANDMARKS): $(READY)
	$(BIN)/facesynth fetch landmarks && touch $@ || echo "tests of capturing from video will be skipped"

clean:
	rm -rf $(VENV)
