"""GEPA drafts a prompt on the tasks to train on; the draft then has to pass the gate on others."""

import argparse
import json
import shlex
import shutil
import subprocess
import sys
from hashlib import sha256
from importlib import import_module
from pathlib import Path
from typing import Any

gepa: Any = import_module("gepa")
ASK = """A model is told this before it places a team of robots in a picture, with tools:
```
<curr_param>
```
This came of it on some tasks:
```
<side_info>
```
Write it anew, so that such faults are fewer. Keep what works, say what holds of any task, and quote
no task. Give the whole new text within ``` blocks."""


def formup(*words: object, codes: tuple[int, ...] = (0,)) -> str:
    """What a command prints; one that refuses raises with its sentence."""
    command = [sys.executable, "-m", "formup", *map(str, words)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode not in codes:
        raise RuntimeError(done.stderr or done.stdout)
    return done.stdout.strip()


class Trials:
    """How a text does on tasks to train on, and what was wrong. Its drafts are the run's own."""

    propose_new_texts = None

    def __init__(self, asked: argparse.Namespace, head: str) -> None:
        self.prompt, self.head, self.out = asked.prompt, head, Path(asked.out)
        self.prompts = shutil.copytree(asked.prompts, self.out / "prompts", dirs_exist_ok=True)
        self.run = ("eval", "run", asked.suite, "--method", "agent", "--model", asked.model)
        self.run += ("--budget", asked.budget)
        self.reflects = shlex.split(asked.reflect)

    def rows(self, text: str, tasks: list[str]) -> list[dict[str, Any]]:
        """What came of a text on tasks, all of them where none is named."""
        name = f"{self.prompt}@draft-{sha256(text.encode()).hexdigest()[:12]}"
        path = self.prompts / f"{name.replace('@', '/')}.prompt.md"
        path.write_text(f"{self.head}\n---\n{text.strip()}\n", "utf-8")
        given = ("--split", "train", "--out", self.out / "train", "--prompts", self.prompts)
        named = [word for task in tasks for word in ("--task", task)]
        codes = (0, 2) if tasks else (0,)  # 2: a text with a {{variable}} more or less
        formup(*self.run, *given, "--prompt", name, *named, codes=codes)
        lines = map(json.loads, (self.out / "train/trials.jsonl").open(encoding="utf-8"))
        found = {row["task"]: row for row in lines if row["arm"]["prompt"] == name}
        refused = {"gcr": 0.0, "outcome": "refused", "feedback": "The text cannot be used."}
        return [found.get(task, refused) for task in tasks or found]

    def evaluate(self, batch: list[str], candidate: dict[str, str], *_: Any, **__: Any) -> Any:
        """As GEPA asks it; what a provider failed in counts as nothing."""
        rows = self.rows(candidate["text"], batch)
        return gepa.EvaluationBatch(rows, [row["gcr"] or 0.0 for row in rows], rows)

    def make_reflective_dataset(self, _: Any, batch: Any, __: Any) -> dict[str, list[Any]]:
        """What came of it and what was wrong, in a sentence each."""
        return {"text": [{k: row[k] for k in ("outcome", "feedback")} for row in batch.outputs]}

    def reflect(self, prompt: str) -> str:
        """The answer of the model that writes."""
        return subprocess.check_output(self.reflects, input=prompt, text=True)


usual = {"suite": "formation-dev", "prompt": "former", "prompts": "mine", "calls": "200"}
usual |= {"trials": "3", "budget": "5", "out": "formup-runs/gepa"}
parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--model", required=True, help="as in formup eval run")
parser.add_argument("--reflect", required=True, help="a command that answers what it is told")
for name, value in usual.items():
    parser.add_argument(f"--{name}", default=value, help=f"default: {value}")
asked = parser.parse_args()
mine, new = ("--prompts", asked.prompts), f"{asked.prompt}@draft-gepa"
draft = Path(formup("prompts", "new", new, *mine))
old = formup("prompts", "show", asked.prompt, *mine).split()[0]
head, _, text = draft.read_text("utf-8").partition("\n---\n")
trials = Trials(asked, head.replace("\nhypothesis:", "\nhypothesis: Drafted by GEPA on train."))
tasks = [row["task"] for row in trials.rows(text, [])]
usual = {"reflection_prompt_template": ASK, "max_metric_calls": int(asked.calls)}
best = gepa.optimize({"text": text}, tasks, adapter=trials, reflection_lm=trials.reflect, **usual)
draft.write_text(f"{trials.head}\n---\n{best.best_candidate['text'].strip()}\n", "utf-8")
formup("prompts", "lint", new, *mine)  # refuses what is copied from tasks
dev, report = trials.out / "dev", trials.out / "gate.json"
tried = ("--split", "dev", "--out", dev, "--trials", asked.trials, *mine)
formup(*trials.run, *tried, "--prompt", old, "--prompt", new)
arms = ("--arm-a", old, "--arm-b", new, "--out", report)
print(formup("eval", "gate", dev, dev, *arms, codes=(0, 1, 3)))  # noqa: T201
print(f"{draft}: read it, then formup prompts release {new} --report {report}")  # noqa: T201
