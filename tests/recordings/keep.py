"""Keeps of traces what a replay needs, without the states of workspaces and where they lay.

python keep.py TRACES FOLDER: every *.jsonl of TRACES, as it was recorded, to FOLDER.
"""

import json
import sys
from pathlib import Path


def kept(trace: Path) -> str:
    """The lines of a recording; the server's address is nobody's business."""
    lines = [json.loads(line) for line in trace.read_text("utf-8").splitlines()]
    whole = [line for line in lines if line["type"] != "state"]
    whole[0]["base_url"] = None
    return "".join(json.dumps(line, ensure_ascii=False) + "\n" for line in whole)


def main() -> None:
    """All of a folder."""
    source, goal = (Path(name) for name in sys.argv[1:])
    goal.mkdir(parents=True, exist_ok=True)
    for trace in sorted(source.glob("*.jsonl")):
        (goal / trace.name).write_text(kept(trace), "utf-8")


if __name__ == "__main__":
    main()
