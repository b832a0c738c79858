# Commands for a newcomer: `make demo`, `make studio` and `make test`. Both make their own environment once.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready
LANDMARKS := $(VENV)/.landmarks

BROWSER := $(VENV)/.browser

.PHONY: demo studio test test-slow lint dist clean

demo: $(READY)
	$(BIN)/facesynth demo

# The workbench on the built-in performer, in the browser.
studio: $(READY)
	$(BIN)/facesynth studio --demo

test: $(LANDMARKS) $(BROWSER) lint
	$(BIN)/python -m pytest -n 2 --dist loadgroup -rs -m "not slow"

test-slow: $(LANDMARKS) $(BROWSER)
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

# The studio is tested in a real browser: one that is here, Debian's, or Playwright's own.
$(BROWSER): $(READY)
	@if { command -v chromium || command -v chromium-browser || command -v google-chrome; } >/dev/null \
	  || { [ "$$(id -u)" = 0 ] && apt-get install -y -qq chromium >/dev/null 2>&1; } \
	  || { [ "$$(id -u)" = 0 ] && apt-get update -qq && apt-get install -y -qq chromium >/dev/null 2>&1; } \
	  || $(BIN)/python -m playwright install --with-deps chromium; \
	then touch $@; else echo "no browser could be had (apt-get install chromium): tests of the studio's page will be skipped"; fi

# The wheel and the source distribution, of facesynth and of its runtime.
dist: $(READY)
	rm -rf dist
	$(BIN)/python -m build --outdir dist .
	$(BIN)/python -m build --outdir dist export/runtime

clean:
	rm -rf $(VENV)
