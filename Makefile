# Each target makes its own virtual environment with the pinned packages when it is missing.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready
# What is imported by many processes is compiled to bytecode once.
export PYTHONDONTWRITEBYTECODE :=

.PHONY: demo check test test-baseline lint format bench bench-constrained bench-binding bench-remaining bench-relaxed bench-batch bench-peers bench-starts bench-places bench-known bench-lost bench-margins bench-bought bench-corrections bench-place bench-first bench-fastest bench-feeds bench-job bench-moved bench-kept bench-moves bench-raster bench-rails bench-lifts bench-numbers bench-spirals bench-latency docs errors short suite suite-made fuzz fuzz-tasks fuzz-cells fuzz-certificate fuzz-deceptions fuzz-generated fuzz-realtime fuzz-files fuzz-pockets fuzz-job fuzz-kept fuzz-programs arms mutants memory acceptance distances study clean

demo: $(READY)  ## plan, check and replay the paper's planar arm and a Panda, into out/
	$(BIN)/selfmotion demo --out out

test: $(READY)  ## the whole test run, on two cores
	$(BIN)/pytest --numprocesses 2 --dist loadfile --no-loadscope-reorder --keep-durations

check: lint  ## style, types, layers and all tests below 0.1 s, on a few arms: a minute
	$(BIN)/pytest --numprocesses 2 --dist worksteal --below 0.1 --arms few

# What plans, and what is computed with it: the rest reads and writes files and pages.
PLANNING := $(addprefix tests/, baselines batch certificate collision constraints costs follow job \
	kernels margins motion nodes optimise paper path placement planning problem realtime result \
	robot search task transfer)

test-baseline: $(READY)  ## the tests that plan, as on a processor without AVX-512
	PYTHONPATH=tests $(BIN)/python -m support.baseline $(BIN)/pytest --numprocesses 2 --dist loadfile \
		--no-loadscope-reorder $(PLANNING)

lint: $(READY)  ## style, types and layers
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

format: $(READY)
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

bench: $(READY)  ## the figures of the first table in docs/pages/performance.md
	$(BIN)/pip install --quiet --constraint constraints.txt -e '.[bench]'
	$(BIN)/python benchmarks/run.py

bench-constrained: $(READY)  ## problems whose constraints bind, against an earlier revision
	OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(BIN)/python benchmarks/constrained.py

bench-binding: $(READY)  ## limits of jerk, bodies and self-collision: with what binds against without
	$(BIN)/python benchmarks/binding.py

bench-relaxed: $(READY)  ## 200 problems with tolerances, judged by kinematics of the tests, against the same without
	OMP_NUM_THREADS=1 $(BIN)/python benchmarks/relaxed.py

bench-remaining: $(READY)  ## the default null motion against splines of 64 intervals
	OMP_NUM_THREADS=1 $(BIN)/python benchmarks/remaining.py

bench-batch: $(READY)  ## two processes against one, and what a plan costs besides planning
	$(BIN)/python benchmarks/batch.py

bench-starts: $(READY)  ## free starts against the best of everything tried, 60 paths
	$(BIN)/python benchmarks/starts.py

bench-first: $(READY)  ## the first plan on a machine; what compiles after a warm-up
	$(BIN)/python benchmarks/first_plan.py

bench-places: $(READY)  ## a seam at 300 places around three arms, each 'no' held against an exhaustive search
	OMP_NUM_THREADS=1 $(BIN)/python benchmarks/places.py

bench-corrections: $(READY)  ## how far parts may stand elsewhere when planned again, held against random displacements
	OMP_NUM_THREADS=1 $(BIN)/python benchmarks/corrections.py

bench-known: $(READY)  ## 18 kinds of 30 problems that have a known motion: what is not found, and what is false
	OMP_NUM_THREADS=1 $(BIN)/python benchmarks/known.py --out out/known.csv

bench-lost: $(READY)  ## costs and verdicts of all these problems against what is kept: what is lost, and dearer
	OMP_NUM_THREADS=1 $(BIN)/python benchmarks/lost.py

bench-margins: $(READY)  ## by how much part, tool and base may be displaced: 200 plans, 10,000 displacements, judged
	OMP_NUM_THREADS=1 $(BIN)/python benchmarks/margins.py

bench-bought: $(READY)  ## margins of 5 mm and 0.5° of 40 plans, displaced and judged; what they have to cost
	OMP_NUM_THREADS=1 $(BIN)/python benchmarks/bought_margins.py

bench-place: $(READY)  ## where to put the part, against places all over the box: 30 problems; 10 maps, against cold plans
	OMP_NUM_THREADS=1 $(BIN)/python benchmarks/place.py --many 400
	OMP_NUM_THREADS=1 $(BIN)/python benchmarks/place.py --maps 5 --count 10

bench-fastest: $(READY)  ## 60 paces against linear programmes; the fastest motions of 20 paths, against retimed plans
	$(BIN)/python benchmarks/paces.py
	$(BIN)/python benchmarks/paces.py --jerk 100
	$(BIN)/python benchmarks/fastest.py

bench-feeds: $(READY)  ## 200 random feeds: refused before planning where no arm has them, kept where verified
	$(BIN)/python benchmarks/feeds.py

bench-moves: $(READY)  ## 100 transfers among boxes, some against 50 tries of OMPL
	$(BIN)/pip install --quiet ompl==2.0.1
	$(BIN)/python benchmarks/moves.py --peer 3

bench-raster: $(READY)  ## rasters of 700 poses that no single motion follows, in parts
	OMP_NUM_THREADS=1 $(BIN)/python benchmarks/raster.py

bench-rails: $(READY)  ## what a metre of a rail is to count: three rails, four weights
	OMP_NUM_THREADS=1 $(BIN)/python benchmarks/rails.py

bench-numbers: $(READY)  ## what each number of the planner decides: doubled and halved, what changes
	OMP_NUM_THREADS=1 $(BIN)/python benchmarks/sensitivity.py

bench-lifts: $(READY)  ## paths of an arm on a torso lift, each with a known motion
	OMP_NUM_THREADS=1 $(BIN)/python benchmarks/lifts.py

bench-spirals: $(READY)  ## loops of a spiral, from a few to an hour of them
	OMP_NUM_THREADS=1 $(BIN)/python benchmarks/spirals.py

fuzz-job: $(READY)  ## random jobs that leave posts; one that is killed at 20 random times, and begun again
	$(BIN)/python benchmarks/random_jobs.py
	$(BIN)/python benchmarks/job_killed.py
	$(BIN)/python benchmarks/job_killed.py --workers 2

fuzz-pockets: $(READY)  ## 200 random programs of pockets and holes, held against an interpreter of its own
	OMP_NUM_THREADS=1 $(BIN)/python benchmarks/pockets.py

fuzz-programs: $(READY)  ## 100 random plans as linear programs, played by a judge of its own; 1,000 programs that were changed
	OMP_NUM_THREADS=1 $(BIN)/python benchmarks/programs.py
	OMP_NUM_THREADS=1 $(BIN)/python benchmarks/changed_programs.py

fuzz-kept: $(READY)  ## 50 folders of jobs and 50 of batches, each spoilt in one way and begun again
	OMP_NUM_THREADS=1 $(BIN)/python benchmarks/kept_folders.py

bench-job: $(READY)  ## a frame of 132 strokes: order, plans, moves past what was made
	$(BIN)/python benchmarks/job.py

bench-moved: $(READY)  ## 30 jobs whose part was moved, planned again from what is kept
	OMP_NUM_THREADS=1 $(BIN)/python benchmarks/moved_parts.py

bench-kept: $(READY)  ## 100 jobs of which a seam was added, removed or moved: what did not change is kept
	OMP_NUM_THREADS=1 $(BIN)/python benchmarks/kept_seams.py

bench-latency: $(READY)  ## 10,000 steps of the replanner: percentiles, misses, and the cost of short sight
	$(BIN)/python benchmarks/latency.py

docs: $(READY)  ## the site, into out/site
	@echo "every example runs for it: some minutes; the site takes 32 MB in out/site"
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --quiet --strict --config-file docs/mkdocs.yml

errors: $(READY)  ## docs/errors.md: every bad input of the tests, and what the user sees
	PYTHONPATH=tests $(BIN)/python -m support.bad_inputs

study: $(READY)  ## the paper re-run, as a report in out/study
	$(BIN)/selfmotion study --out out/study

clean:
	rm -rf $(VENV) out

$(READY): pyproject.toml constraints.txt
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "selfmotion needs Python 3.11 or newer")'
	$(PYTHON) -m venv $(VENV)
	PIP_CONSTRAINT=constraints.txt $(BIN)/pip install --quiet --disable-pip-version-check -e '.[dev]'
	touch $@

short: $(READY)  ## every benchmark and fuzz with few problems: whether it still runs
	$(BIN)/pip install --quiet --constraint constraints.txt -e '.[mutants]'
	OMP_NUM_THREADS=1 $(BIN)/python benchmarks/short.py

suite: $(READY)  ## path problems made elsewhere, planned and scored
	$(BIN)/python benchmarks/suite.py

suite-made: $(READY)  ## 12 problems made at random that have a known motion, planned and scored
	$(BIN)/python benchmarks/made.py --out out/made
	$(BIN)/python benchmarks/suite.py --folder out/made --out out/suite-made

fuzz: $(READY)  ## 200 random paths, judged by an independent checker
	$(BIN)/python benchmarks/fuzz.py

fuzz-tasks: $(READY)  ## 200 position and pointing tasks among boxes, judged by the suite's judge
	$(BIN)/python benchmarks/fuzz_tasks.py

fuzz-cells: $(READY)  ## 200 random cells of two chains, judged by kinematics of the tree
	$(BIN)/python benchmarks/fuzz_cells.py

fuzz-certificate: $(READY)  ## 900 motions made to deceive, judged independently; the price of proof
	$(BIN)/python benchmarks/certificate.py

fuzz-deceptions: $(READY)  ## 2,004 motions made to deceive who reads the source, against an oracle
	OMP_NUM_THREADS=1 $(BIN)/python benchmarks/deceptions.py

fuzz-generated: $(READY)  ## 5,000 generated problems: confirmed verdicts and typed errors only
	$(BIN)/python benchmarks/generated.py

fuzz-realtime: $(READY)  ## 1,000 scenarios of pushes, late steps, jumps and faults, in a closed loop
	$(BIN)/python benchmarks/fuzz_realtime.py

fuzz-files: $(READY)  ## 20,000 spoiled files of all kinds: read, or refused in one line
	$(BIN)/python benchmarks/fuzz_files.py

arms: $(READY)  ## docs/chains.md: what loads, plans and is verified of robot descriptions; needs a network
	$(BIN)/pip install --quiet --constraint constraints.txt -e '.[arms]'
	$(BIN)/python benchmarks/arms.py

mutants: $(READY)  ## faults put into the parts that all else stands on, and how many tests catch
	$(BIN)/pip install --quiet --constraint constraints.txt -e '.[mutants]'
	OMP_NUM_THREADS=1 $(BIN)/python benchmarks/mutants.py

memory: $(READY)  ## 10,000 plans in one process, and its memory
	$(BIN)/python benchmarks/memory.py

acceptance: $(READY)  ## 200 random plans, driven at 1 kHz by what the makers publish of their arms
	$(BIN)/python benchmarks/acceptance.py

distances: $(READY)  ## 100,000 distances of bodies of all kinds, judged without GJK
	$(BIN)/python benchmarks/distances.py

bench-peers: $(READY)  ## other tools on the same paths and cells, in environments of their own
	$(BIN)/python benchmarks/peers/run_peers.py
	OMP_NUM_THREADS=1 $(BIN)/python benchmarks/peers/run_cells.py
