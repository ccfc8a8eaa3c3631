"""A prompt engineer's half hour as a notebook: draft, cost, run, compare, gate, release, roll back.

Each `# %%` is a cell in VS Code, PyCharm and, with jupytext, in Jupyter. It calls the command line,
so that a notebook has no way past the gate.
"""

# %% The text to try, on what, by whom, and for how much
import json
import os
import subprocess
import sys
from pathlib import Path

DRAFT = Path(os.getenv("DRAFT", "draft.txt"))
SUITE = os.getenv("SUITE", "formation-dev")
MODELS = os.getenv("MODELS", "simulated").split()  # such as "openai:NAME anthropic:NAME"
TRIALS, BUDGET = os.getenv("TRIALS", "3"), os.getenv("BUDGET", "1")  # tries of a task, USD
ID, MINE, RUN = "brisk", Path("mine"), Path("formup-runs/half-hour")
os.environ["FORMUP_PROMPTS"] = str(MINE)
if not DRAFT.is_file():
    sys.exit(f"Write the text to try into {DRAFT} first, or name another file with DRAFT=FILE.")


def formup(*words: object, codes: tuple[int, ...] = (0,)) -> str:
    """What a command prints; one that refuses raises with its sentence."""
    command = [sys.executable, "-m", "formup", *map(str, words)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode not in codes:
        raise RuntimeError(done.stderr or done.stdout)
    print(done.stdout)  # noqa: T201
    return done.stdout.strip()


# %% A first version of one's own, where there is none; then the draft of the next
if not (MINE / ID).exists():
    formup("prompts", "new", f"{ID}@draft-first", "--from", "former")
    formup("prompts", "release", f"{ID}@draft-first", "--why", "as former, to begin with")
path = Path(formup("prompts", "new", f"{ID}@draft-mine"))
head = path.read_text("utf-8").partition("\n---\n")[0]
head = head.replace("\nhypothesis:", "\nhypothesis: Written in a notebook.")
path.write_text(f"{head}\n---\n{DRAFT.read_text('utf-8')}", "utf-8")
formup("prompts", "lint", f"{ID}@draft-mine")
formup("prompts", "diff", ID, f"{ID}@draft-mine")

# %% What it costs, before it is spent
sweep = ["eval", "run", SUITE, "--method", "agent", "--trials", TRIALS, "--budget", BUDGET]
sweep += [word for model in MODELS for word in ("--model", model)]
sweep += ["--prompt", ID, "--prompt", f"{ID}@draft-mine", "--out", str(RUN)]
formup(*sweep, "--dry-run")

# %% Run it; a cell that was interrupted goes on where it was
formup(*sweep)

# %% Compare, and look at what went wrong, side by side, of each model
prompts = json.loads(formup("prompts", "list", "--json"))
old = next(p["name"] for p in prompts if p["current"] and p["name"].startswith(f"{ID}@"))
arms = {m: ("--arm-a", f"{old} {m}", "--arm-b", f"{ID}@draft-mine {m}") for m in MODELS}
for number, model in enumerate(MODELS):
    formup("eval", "compare", RUN, RUN, *arms[model])
    page = ("--out", f"half-hour-{number}.html")
    formup("eval", "report", RUN, "--against", RUN, *arms[model], *page)

# %% The gate, for the model in use, the first: 0 pass, 1 block, 3 inconclusive
formup("eval", "gate", RUN, RUN, *arms[MODELS[0]], "--out", "gate.json", codes=(0, 1, 3))
passed = json.loads(Path("gate.json").read_text("utf-8"))["verdict"] == "pass"

# %% Release and promote what has passed
if passed:
    why = ("--why", "passed in a notebook", "--report", "gate.json")
    new = formup("prompts", "release", f"{ID}@draft-mine", *why)
    formup("prompts", "promote", new, "--report", "gate.json")

# %% Roll back, if it turns out badly later
if passed and (why := os.getenv("ROLL_BACK")):
    formup("prompts", "promote", old, "--force", "--why", why)
formup("prompts", "log", ID)
