"""Runs one framework in its own environment for `run.py`, with JSON lines in and out."""

import asyncio
import importlib
import json
import os
import sys
import time
import traceback
from pathlib import Path
from typing import Any

from exchange import FINAL


def cpu() -> float:
    """Return the CPU seconds this process has used, in the kernel too."""
    return time.process_time()


async def measured(module: Any, command: dict[str, Any]) -> dict[str, Any]:
    """Return the CPU time of `runs` conversations, one after the other or all at once."""
    run = module.run_stream if command["stream"] else module.run

    async def one() -> None:
        answer = await run(command["url"])
        assert answer == FINAL, repr(answer)

    before = cpu()
    if command["at_once"]:
        await asyncio.gather(*(one() for _ in range(command["runs"])))
    else:
        for _ in range(command["runs"]):
            await one()
    return {"cpu": cpu() - before}


async def main(name: str, out: Any) -> None:
    """Carry out commands until the end of the input."""
    module = importlib.import_module(name)
    out.write('"ready"\n')
    loop = asyncio.get_running_loop()
    while line := await loop.run_in_executor(None, sys.stdin.readline):
        try:
            answer = await measured(module, json.loads(line))
        except Exception as error:
            traceback.print_exc()
            answer = {"error": f"{type(error).__name__}: {error}"[:400]}
        out.write(json.dumps(answer) + "\n")


if __name__ == "__main__":
    sys.path.append(str(Path(__file__).parent / "peers"))
    answers = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(2, 1)  # a framework that prints must not spoil the answers
    asyncio.run(main(sys.argv[1], answers))
