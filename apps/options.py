"""The command line's options, each declared once."""

from pathlib import Path
from typing import Annotated

import typer

from .run_files import film_file, trajectory_file

ImageOrWords = Annotated[
    str | None, typer.Argument(metavar="IMAGE", help="Picture of the place; not with --camera.")
]
Instruction = Annotated[
    str | None, typer.Argument(metavar="INSTRUCTION", help="What to do, in your words.")
]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")]
Robots = Annotated[str | None, typer.Option("-n", "--robots", help="How many, 1 to 10,000.")]
Points = Annotated[
    list[str] | None, typer.Option("--point", help="X,Y on the thing meant; repeatable.")
]
Boxes = Annotated[
    list[str] | None, typer.Option("--box", help="X0,Y0,X1,Y1 close around it; repeatable.")
]
Outlines = Annotated[
    list[str] | None,
    typer.Option("--outline", help="X1,Y1,X2,Y2,...: 3 to 200 rough vertices; repeatable."),
]
Candidates = Annotated[
    list[str] | None,
    typer.Option("--target", help="A thing found in the picture, such as c3; repeatable."),
]
Masks = Annotated[
    list[Path] | None,
    typer.Option(
        "--mask",
        help="A file with the exact masks of things: PNG, COCO, LabelMe, GeoJSON or YOLO .txt; "
        "repeatable.",
    ),
]
KeepOuts = Annotated[
    list[str] | None,
    typer.Option(
        "--keep-out",
        help="Where no robot may stand or drive: a box or an outline as above, X,Y on a thing, or "
        "an id such as c3; repeatable.",
    ),
]
ContractFile = Annotated[
    Path | None,
    typer.Option("--contract", help="A contract as JSON, used as it stands; no words are read."),
]
PlanOnly = Annotated[bool, typer.Option("--plan-only", help="Certify a plan but move nothing.")]
Out = Annotated[
    Path | None, typer.Option("--out", help="Folder for the files; default: formup-runs/TIME.")
]
DemoOut = Annotated[Path, typer.Option("--out", help="Folder for the files, one for each.")]
ModelName = Annotated[
    str,
    typer.Option(
        "--model",
        help="Who decides: offline (rules, no AI), or openai:, openai-responses:, anthropic:, "
        "gemini: or ollama:NAME.",
    ),
]
BaseUrl = Annotated[
    str | None, typer.Option("--base-url", help="The model's server, if not the provider's own.")
]
PlannerName = Annotated[
    str | None,
    typer.Option(
        "--planner",
        help="A second model, PROVIDER:NAME, that makes the formation without seeing the picture.",
    ),
]
PromptName = Annotated[
    str | None,
    typer.Option(
        "--prompt", help="ID@VERSION, or ID for its current one; the offline rules read none."
    ),
]
PromptsFolder = Annotated[
    Path | None,
    typer.Option(
        "--prompts",
        envvar="FORMUP_PROMPTS",
        help="A folder of prompts of your own, on top of the shipped ones.",
    ),
]
PromptArgument = Annotated[
    str, typer.Argument(metavar="NAME", help="ID@VERSION, or ID for its current one.")
]
PromptNames = Annotated[
    list[str] | None, typer.Argument(metavar="[NAME]...", help="Only these; default: all.")
]
PromptId = Annotated[str, typer.Argument(metavar="ID", help="Of a prompt, such as former.")]
DraftName = Annotated[str, typer.Argument(metavar="ID@draft-NAME", help="Of the draft.")]
ParentName = Annotated[
    str | None, typer.Option("--from", help="ID@VERSION to begin with, if not the current one.")
]
Variables = Annotated[
    list[str] | None, typer.Option("--var", help="NAME=VALUE of an input; repeatable.")
]
Why = Annotated[str, typer.Option("--why", help="The reason, for the changelog.")]
ComparisonFile = Annotated[
    Path | None, typer.Option("--report", help="What `formup eval compare` wrote.")
]
Force = Annotated[bool, typer.Option("--force", help="Without a comparison; say --why.")]
Baselines = Annotated[
    Path | None,
    typer.Option("--baselines", help='JSON with scores: {"ID@VERSION": {"SUITE": NUMBER}}.'),
]
Numbered = Annotated[
    bool,
    typer.Option("--numbered", help="Number what stands out in the picture a model gets."),
]
Record = Annotated[
    Path | None,
    typer.Option("--record", help="Where to keep the run, for --model replay:FILE."),
]
Film = Annotated[
    Path | None,
    typer.Option(
        "--film",
        callback=film_file,
        help="Where a film of the robots goes too: .gif, .mp4, or .png, a strip of moments.",
    ),
]
TrajectoryFile = Annotated[
    Path | None,
    typer.Option(
        "--trajectories",
        callback=trajectory_file,
        help="Write how robots get there, .json or .csv, and move none.",
    ),
]
Watch = Annotated[bool, typer.Option("--watch", help="Show robots in a window while they drive.")]
FollowFor = Annotated[
    float | None,
    typer.Option(
        "--follow", help="Then follow the thing for so many seconds.", min=0.1, max=86_400
    ),
]
FollowSpeed = Annotated[
    float | None,
    typer.Option("--follow-speed", help="As fast as this at most, px per second.", min=0.1),
]
LimitList = Annotated[
    list[str] | None,
    typer.Option(
        "--limit",
        help="NAME=VALUE: requests, tool_calls, tokens, cost_usd, seconds, tool_seconds, "
        "reply_seconds; repeatable.",
    ),
]
PolicyList = Annotated[
    list[str] | None,
    typer.Option("--policy", help="GLOB=allow, ask or refuse, for tools' names; repeatable."),
]
NextWords = Annotated[
    str | None, typer.Argument(help="What to do next, as in the words of an instruction.")
]
RunFolder = Annotated[Path, typer.Argument(help="A run's folder, or its trace.")]
Answer = Annotated[
    str | None, typer.Option("--answer", help="To the question; with --refuse, why.")
]
Approve = Annotated[
    bool | None,
    typer.Option("--approve/--refuse", help="Your yes or no to what waits.", show_default=False),
]
ResumeModel = Annotated[
    str | None, typer.Option("--model", help="Another than before, as in formup run.")
]
ChatImage = Annotated[
    Path | None,
    typer.Argument(help="Picture of the place; not with --camera, nor needed with --session."),
]
Script = Annotated[
    Path | None,
    typer.Option("--script", help="What to say, a line a turn, instead of a person's typing."),
]
ScriptJson = Annotated[
    bool, typer.Option("--json", help="Print one JSON object a line for each turn, nothing else.")
]
SessionId = Annotated[
    str | None, typer.Option("--session", help="Go on with a stored session.", metavar="ID")
]
StoreUrl = Annotated[
    str | None,
    typer.Option(
        "--store",
        envvar="FORMUP_STORE",
        help="Where sessions are: a folder, sqlite:///FILE or postgresql://...; default: the "
        "user's data folder.",
    ),
]
Auto = Annotated[
    bool, typer.Option("--auto", help="Simulated robots move at once, not only at go.")
]
Plain = Annotated[
    bool, typer.Option("--plain", help="Nothing but lines of text, for screen readers.")
]
TraceFile = Annotated[Path, typer.Argument(help="A run's trace, or its folder.")]
DetectorName = Annotated[
    str | None, typer.Option("--detector", help="How things are found: NAME or NAME:CHECKPOINT.")
]
SegmenterName = Annotated[
    str | None, typer.Option("--segmenter", help="How outlines are made: NAME or NAME:CHECKPOINT.")
]
Threshold = Annotated[
    str | None, typer.Option("--threshold", help="Least confidence a mask is used at, 0 to 1.")
]
DescriptorName = Annotated[
    str, typer.Option("--descriptor", help="Shapes as edges, edges+vertices or matrix.")
]
FleetName = Annotated[str, typer.Option("--fleet", help="Which robots move: NAME, or a YAML FILE.")]
Starts = Annotated[
    Path | None, typer.Option("--starts", help="Starting positions: x,y a line, or JSON.")
]
MetresPerPixel = Annotated[
    str | None,
    typer.Option("--metres-per-pixel", help="Scale of a picture taken straight from above."),
]
Camera = Annotated[
    str | None,
    typer.Option("--camera", help="Takes the picture: the number of a device, a URL or a FILE."),
]
CalibrationFile = Annotated[
    Path | None,
    typer.Option("--calibration", help="Of the camera, by formup calibrate: shows its floor."),
]
Radius = Annotated[
    str | None, typer.Option("--robot-radius", help="Radius of a robot: px, or such as 20cm.")
]
Clearance = Annotated[
    str | None,
    typer.Option("--clearance", help="Exact distance from the target: px, or such as 1.5m."),
]
Seed = Annotated[str, typer.Option("--seed", help="Of the simulator.")]
Arguments = Annotated[str, typer.Option("--args", help="The tool's arguments as JSON.")]
StateFile = Annotated[Path | None, typer.Option("--state", help="Keeps the scene between calls.")]
DrawnFile = Annotated[
    Path | None, typer.Option("--picture", help="Draws the plan, or what was measured, as PNG.")
]
PlanFile = Annotated[Path, typer.Argument(help="A plan.json that formup wrote.")]
PictureFile = Annotated[Path | None, typer.Option("--image", help="The picture to work on.")]
OldRun = Annotated[Path, typer.Argument(metavar="A", help="Folder of trials: the baseline.")]
NewRun = Annotated[Path, typer.Argument(metavar="B", help="Folder of trials: the new version.")]
OldArm = Annotated[
    str | None,
    typer.Option("--arm-a", help="Which of A's, if several: words of method, prompt, model."),
]
NewArm = Annotated[
    str | None,
    typer.Option("--arm-b", help="Which of B's, if several: words of method, prompt, model."),
]
MetricName = Annotated[str, typer.Option("--metric", help="What is compared: sr, strict or gcr.")]
Margin = Annotated[
    str, typer.Option("--margin", help="Loss of success the gate tolerates, as a share.")
]
ReportFile = Annotated[
    Path | None, typer.Option("--out", help="Where to write the comparison as JSON.")
]
Shards = Annotated[list[Path], typer.Argument(help="Folders of trials.", show_default=False)]
MergedFolder = Annotated[Path, typer.Option("--out", help="The new folder.", show_default=False)]
