# Each target makes its own virtual environment with the pinned packages when it is missing.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready
# What is imported by many processes is compiled to bytecode once.
export PYTHONDONTWRITEBYTECODE :=

.PHONY: help demo check quick test test-site test-baseline test-interpreted lint style format bench short wheel docs errors three clean

help:  ## this list
	@grep -hE '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:.*## */\t/' | expand -t 18

demo: $(READY)  ## plan, check and replay the paper's planar arm and a Panda, into out/
	$(BIN)/selfmotion demo --out out

# What takes long, as the site, which runs every example, or is seen in a browser, is a target of its
# own: `site`.
TWO := --numprocesses 2
BY_FILE := --dist loadfile --no-loadscope-reorder

test: $(READY)  ## all tests but those of `test-site`, on two cores
	$(BIN)/pytest $(TWO) $(BY_FILE) -m 'not site' --keep-durations

test-site: $(READY)  ## long tests: the site, pages in a browser, the study of the paper
	$(BIN)/pytest $(TWO) $(BY_FILE) -m site

check: $(READY)  ## style, types, layers and all tests below 0.1 s, on a few arms: a minute
	$(MAKE) --jobs 2 --output-sync style quick

quick: $(READY)
	$(BIN)/pytest $(TWO) --dist worksteal -m 'not site' --below 0.1 --arms few

# What plans, and what is computed with it: the rest reads and writes files and pages.
PLANNING := $(addprefix tests/, baselines batch certificate collision constraints costs follow job \
	kernels margins motion nodes optimise paper path placement planning problem realtime result \
	robot rollout search task transfer)

test-baseline: $(READY)  ## the tests that plan, as on a processor without AVX-512
	PYTHONPATH=tests $(BIN)/python -m support.baseline $(BIN)/pytest $(TWO) $(BY_FILE) $(PLANNING)

test-interpreted: $(READY)  ## cheap tests with kernels that are interpreted: a quarter of an hour
	NUMBA_DISABLE_JIT=1 $(BIN)/pytest $(TWO) --dist worksteal -m 'not site' --below 0.06 --arms few

lint: style  ## style, types, layers and words
	$(BIN)/pytest tests/docs/test_words.py

style: $(READY)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

format: $(READY)  ## fixes of style that need no thought
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

bench: $(READY)  ## a benchmark, make bench NAME=places; without a name, the list of them
	$(BIN)/python benchmarks $(NAME)

short: $(READY)  ## every benchmark with few problems: whether it still runs
	$(BIN)/python benchmarks --short

wheel: $(READY)  ## a wheel in dist/, with kernels for every x86-64-v3 (or aarch64)
	PYTHONPATH=tests PIP_CONSTRAINT=constraints.txt $(BIN)/python -m support.baseline \
		$(BIN)/pip wheel --quiet --no-deps --wheel-dir dist .

docs: $(READY)  ## the site, into out/site
	@echo "every example runs for it: some minutes; the site takes 32 MB in out/site"
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --quiet --strict --config-file docs/mkdocs.yml

errors: $(READY)  ## docs/errors.md: every bad input of the tests, and what the user sees
	PYTHONPATH=tests $(BIN)/python -m support.bad_inputs

# What the pages take of three.js, from its own package; `entry.js` lists it.
THREE := src/selfmotion/shell/replay/web/three
THREE_VERSION := 0.187.0
three:  ## three.js for the pages, from its package, into the source; needs npm
	rm -rf out/three && mkdir -p out/three && cp $(THREE)/entry.js out/three
	cd out/three && npm install --silent --no-save three@$(THREE_VERSION) esbuild@0.28.2
	cd out/three && npx esbuild entry.js --bundle --minify --format=iife --global-name=THREE --target=es2022 \
		--banner:js="/* three.js $(THREE_VERSION), MIT licence, Copyright 2010-2026 three.js authors: see LICENSE beside this file. */" \
		--legal-comments=none --log-level=warning --outfile=$(CURDIR)/$(THREE)/three.min.js
	cp out/three/node_modules/three/LICENSE $(THREE)/LICENSE

clean:  ## the environment and out/ go
	rm -rf $(VENV) out

$(READY): pyproject.toml constraints.txt
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "selfmotion needs Python 3.11 or newer")'
	$(PYTHON) -m venv $(VENV)
	PIP_CONSTRAINT=constraints.txt $(BIN)/pip install --quiet --disable-pip-version-check -e '.[dev]'
	$(BIN)/selfmotion warm-up
	touch $@
