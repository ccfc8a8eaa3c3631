"""The command line's options, each declared once."""

from pathlib import Path
from typing import Annotated

import typer

from .run_files import film_file, trajectory_file

ImageOrWords = Annotated[
    str | None, typer.Argument(metavar="IMAGE", help="Picture of the place; omit with --camera.")
]
Instruction = Annotated[
    str | None,
    typer.Argument(metavar="INSTRUCTION", help="What the robots should do, in your own words."),
]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON document and nothing else.")]
Robots = Annotated[
    str | None, typer.Option("-n", "--robots", help="Number of robots, 1 to 10,000.")
]
Points = Annotated[
    list[str] | None, typer.Option("--point", help="X,Y of a point on a target; repeatable.")
]
Boxes = Annotated[
    list[str] | None,
    typer.Option("--box", help="X0,Y0,X1,Y1 of a tight box around a target; repeatable."),
]
Outlines = Annotated[
    list[str] | None,
    typer.Option(
        "--outline",
        help="X1,Y1,X2,Y2,... of a rough outline of a target, 3 to 200 vertices; repeatable.",
    ),
]
Candidates = Annotated[
    list[str] | None,
    typer.Option(
        "--target",
        help="ID of a target among the things found in the picture, such as c3; repeatable.",
    ),
]
Masks = Annotated[
    list[Path] | None,
    typer.Option(
        "--mask",
        help="File with exact masks of targets: PNG, COCO, LabelMe, GeoJSON or YOLO .txt; "
        "repeatable.",
    ),
]
KeepOuts = Annotated[
    list[str] | None,
    typer.Option(
        "--keep-out",
        help="Area where no robot may stand or drive: a box or outline as above, X,Y of a point on "
        "a thing, or an ID such as c3; repeatable.",
    ),
]
ContractFile = Annotated[
    Path | None,
    typer.Option(
        "--contract",
        help="JSON file with the contract to carry out as is; the instruction is not interpreted.",
    ),
]
PlanOnly = Annotated[bool, typer.Option("--plan-only", help="Certify a plan, but move no robots.")]
Out = Annotated[
    Path | None, typer.Option("--out", help="Output folder; default: formup-runs/TIME.")
]
DemoOut = Annotated[
    Path, typer.Option("--out", help="Output folder, with a subfolder for each run.")
]
ModelName = Annotated[
    str,
    typer.Option(
        "--model",
        help="Model that decides: offline (rules, no AI), openai:NAME, openai-responses:NAME, "
        "anthropic:NAME, gemini:NAME, ollama:NAME or replay:FILE.",
    ),
]
BaseUrl = Annotated[
    str | None,
    typer.Option("--base-url", help="URL of the model's server, if not the provider's own."),
]
PlannerName = Annotated[
    str | None,
    typer.Option(
        "--planner",
        help="Second model, PROVIDER:NAME, that plans the formation without seeing the picture.",
    ),
]
PromptName = Annotated[
    str | None,
    typer.Option(
        "--prompt", help="Prompt: ID@VERSION, or ID for its current version; offline uses none."
    ),
]
PromptsFolder = Annotated[
    Path | None,
    typer.Option(
        "--prompts",
        envvar="FORMUP_PROMPTS",
        help="Folder of your own prompts, used in addition to the shipped ones.",
    ),
]
PromptArgument = Annotated[
    str, typer.Argument(metavar="NAME", help="Prompt: ID@VERSION, or ID for its current version.")
]
PromptNames = Annotated[
    list[str] | None, typer.Argument(metavar="[NAME]...", help="Prompts to check; default: all.")
]
PromptId = Annotated[str, typer.Argument(metavar="ID", help="ID of a prompt, such as former.")]
DraftName = Annotated[str, typer.Argument(metavar="ID@draft-NAME", help="Name of the draft.")]
ParentName = Annotated[
    str | None,
    typer.Option("--from", help="ID@VERSION to start from; default: the current version."),
]
Variables = Annotated[
    list[str] | None,
    typer.Option("--var", help="NAME=VALUE for an input of the prompt; repeatable."),
]
Why = Annotated[str, typer.Option("--why", help="Reason, for the changelog.")]
ComparisonFile = Annotated[
    Path | None, typer.Option("--report", help="Comparison written by formup eval compare --out.")
]
Force = Annotated[
    bool, typer.Option("--force", help="Promote without a comparison; requires --why.")
]
Baselines = Annotated[
    Path | None,
    typer.Option("--baselines", help='JSON file with scores: {"ID@VERSION": {"SUITE": NUMBER}}.'),
]
Numbered = Annotated[
    bool,
    typer.Option(
        "--numbered", help="Number the things that stand out in the picture sent to the model."
    ),
]
Record = Annotated[
    Path | None,
    typer.Option("--record", help="Record the run to this file, for --model replay:FILE."),
]
Film = Annotated[
    Path | None,
    typer.Option(
        "--film",
        callback=film_file,
        help="Also write a film of the robots to this file: .gif, .mp4, or .png for a strip of "
        "frames.",
    ),
]
TrajectoryFile = Annotated[
    Path | None,
    typer.Option(
        "--trajectories",
        callback=trajectory_file,
        help="Write the robots' trajectories to this .json or .csv file and move none.",
    ),
]
Watch = Annotated[
    bool, typer.Option("--watch", help="Show the robots in a window while they drive.")
]
FollowFor = Annotated[
    float | None,
    typer.Option(
        "--follow",
        help="After arriving, follow the target for this many seconds.",
        min=0.1,
        max=86_400,
    ),
]
FollowSpeed = Annotated[
    float | None,
    typer.Option(
        "--follow-speed", help="Maximum speed while following, in px per second.", min=0.1
    ),
]
LimitList = Annotated[
    list[str] | None,
    typer.Option(
        "--limit",
        help="Limit a turn, NAME=VALUE; NAME is requests, tool_calls, tokens, cost_usd, seconds, "
        "tool_seconds or reply_seconds; repeatable.",
    ),
]
PolicyList = Annotated[
    list[str] | None,
    typer.Option(
        "--policy",
        help="GLOB=allow, GLOB=ask or GLOB=refuse, for tools whose names match; repeatable.",
    ),
]
NextWords = Annotated[str | None, typer.Argument(help="Next instruction, in your own words.")]
RunFolder = Annotated[Path, typer.Argument(help="Folder of a run, or its trace file.")]
Answer = Annotated[
    str | None,
    typer.Option("--answer", help="Answer to the open question; with --refuse, the reason."),
]
Approve = Annotated[
    bool | None,
    typer.Option(
        "--approve/--refuse", help="Approve or refuse what waits for approval.", show_default=False
    ),
]
ResumeModel = Annotated[
    str | None,
    typer.Option("--model", help="Model to continue with, as in formup run; default: the same."),
]
ChatImage = Annotated[
    Path | None,
    typer.Argument(help="Picture of the place; omit with --camera, optional with --session."),
]
Script = Annotated[
    Path | None,
    typer.Option(
        "--script", help="Read the turns from this file, one per line, instead of the keyboard."
    ),
]
ScriptJson = Annotated[
    bool,
    typer.Option(
        "--json", help="Print one JSON object per turn, each on a line, and nothing else."
    ),
]
SessionId = Annotated[
    str | None, typer.Option("--session", help="Continue a stored session.", metavar="ID")
]
StoreUrl = Annotated[
    str | None,
    typer.Option(
        "--store",
        envvar="FORMUP_STORE",
        help="Where sessions are stored: a folder, sqlite:///FILE or postgresql://...; default: "
        "the user's data folder.",
    ),
]
Auto = Annotated[
    bool, typer.Option("--auto", help="Move simulated robots at once, without waiting for go.")
]
Plain = Annotated[
    bool, typer.Option("--plain", help="Plain lines of text only, for screen readers.")
]
TraceFile = Annotated[Path, typer.Argument(help="Trace file of a run, or its folder.")]
DetectorName = Annotated[
    str | None,
    typer.Option("--detector", help="Detector that finds things: NAME or NAME:CHECKPOINT."),
]
SegmenterName = Annotated[
    str | None,
    typer.Option("--segmenter", help="Segmenter that outlines things: NAME or NAME:CHECKPOINT."),
]
Threshold = Annotated[
    str | None,
    typer.Option("--threshold", help="Minimum confidence for a mask to be used, 0 to 1."),
]
DescriptorName = Annotated[
    str,
    typer.Option(
        "--descriptor",
        help="How shapes are described to the model: edges, edges+vertices or matrix.",
    ),
]
FleetName = Annotated[
    str, typer.Option("--fleet", help="Fleet of robots to move: NAME, or a YAML FILE.")
]
Starts = Annotated[
    Path | None,
    typer.Option("--starts", help="File with starting positions: one x,y per line, or JSON."),
]
MetresPerPixel = Annotated[
    str | None,
    typer.Option("--metres-per-pixel", help="Scale of a picture taken from straight above."),
]
Camera = Annotated[
    str | None,
    typer.Option("--camera", help="Camera that takes the picture: device number, URL or FILE."),
]
CalibrationFile = Annotated[
    Path | None,
    typer.Option(
        "--calibration",
        help="Camera calibration by formup calibrate; rectifies the picture to a top view of the "
        "floor.",
    ),
]
Radius = Annotated[
    str | None,
    typer.Option("--robot-radius", help="Radius of a robot: pixels, or with a unit, such as 20cm."),
]
Clearance = Annotated[
    str | None,
    typer.Option(
        "--clearance", help="Exact distance from the target: pixels, or with a unit, such as 1.5m."
    ),
]
Seed = Annotated[str, typer.Option("--seed", help="Random seed of the simulator.")]
Arguments = Annotated[str, typer.Option("--args", help="Arguments of the tool, as a JSON object.")]
StateFile = Annotated[
    Path | None, typer.Option("--state", help="File that keeps the scene between calls.")
]
DrawnFile = Annotated[
    Path | None,
    typer.Option("--picture", help="Draw the plan, or what was measured, to this PNG file."),
]
PlanFile = Annotated[Path, typer.Argument(help="A plan.json written by formup.")]
PictureFile = Annotated[Path | None, typer.Option("--image", help="Picture to work on.")]
OldRun = Annotated[Path, typer.Argument(metavar="A", help="Folder of the baseline's trials.")]
NewRun = Annotated[Path, typer.Argument(metavar="B", help="Folder of the new version's trials.")]
OldArm = Annotated[
    str | None,
    typer.Option(
        "--arm-a", help="Arm of A, if it has several: words from its method, prompt or model."
    ),
]
NewArm = Annotated[
    str | None,
    typer.Option(
        "--arm-b", help="Arm of B, if it has several: words from its method, prompt or model."
    ),
]
MetricName = Annotated[str, typer.Option("--metric", help="Metric to compare: sr, strict or gcr.")]
Margin = Annotated[
    str, typer.Option("--margin", help="Largest loss of success the gate tolerates, as a fraction.")
]
ReportFile = Annotated[
    Path | None, typer.Option("--out", help="Also write the comparison to this JSON file.")
]
Shards = Annotated[
    list[Path], typer.Argument(help="Folders of trials to merge.", show_default=False)
]
MergedFolder = Annotated[Path, typer.Option("--out", help="Folder to create.", show_default=False)]
