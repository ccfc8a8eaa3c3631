"""What prompts give away of the suites, and whether their tools are still those of the release."""

from datetime import date
from pathlib import Path

import pytest
from formup.evals.experiments.tool_versions import retooled, tool_hashes
from formup.evals.tasks.prompt_leaks import leaks
from formup.evals.tasks.suites import load_suite
from formup.prompts import Prompt, PromptLibrary, load_prompt
from formup.prompts.prompt import parse_prompt
from formup.prompts.release import new_draft, release
from formup.tools.builtin import TOOLS


def prompt(text: str, head: str = "") -> Prompt:
    source = f"---\nid: mine\nsummary: x\n{head}---\n{text}"
    return parse_prompt("mine@draft-x", source, lambda ref: "")


def test_the_shipped_prompts_give_nothing_away() -> None:
    for name in PromptLibrary().names():
        assert leaks(load_prompt(name)) == []


def test_the_current_prompts_name_tools_that_there_are() -> None:
    for id in PromptLibrary().ids():
        assert set(load_prompt(id).tools) <= {tool.name for tool in TOOLS}


@pytest.mark.parametrize("number", [0, 7, 29])
def test_words_of_a_task_are_found(number: int) -> None:
    words = load_suite("photos").tasks[number].instruction.split()
    assert len(words) >= 5
    assert leaks(prompt(f"For example: {' '.join(words[:5]).upper()}"))
    assert not leaks(prompt(f"For example: {' '.join(words[:4])}"))


def test_words_of_the_drawn_scenes_are_found() -> None:
    assert leaks(prompt("Have {n} robots ring {thing}, all the same distance apart."))


def test_places_in_pictures_are_found_in_any_form() -> None:
    for text in ("[320.0, 124.5]", "(320,124.5)", "at 320, 124.50 or so"):
        (finding,) = leaks(prompt(text))
        assert (finding.rule, finding.severity) == ("leak", "error")
    assert not leaks(prompt("[320.0, 124.4] and 4 robots, 2 rows"))


def test_examples_of_inputs_are_looked_at() -> None:
    inputs = "inputs: {how: {type: string, example: Block the silver car in with 7 robots.}}\n"
    assert leaks(prompt("{{how}}", inputs))


def test_tools_that_changed_since_the_release_are_named(tmp_path: Path) -> None:
    library = PromptLibrary(tmp_path)
    new_draft(library, "former@draft-x")
    draft = library.load("former@draft-x")
    hashes = tool_hashes(draft)
    assert set(hashes) == set(draft.tools)
    name = release(library, "former@draft-x", "x", date(2026, 11, 25), hashes | {"look": "0"})
    (finding,) = retooled(library, library.load(name))
    assert finding.severity == "warning"
    assert "Released for look as they were then" in finding.sentence
    assert len(tool_hashes(load_prompt("former@v001"))) == len(TOOLS)


def test_tools_that_are_none_are_named() -> None:
    made = prompt("text", "tools: [look, fly]\n")
    (finding,) = retooled(PromptLibrary(), made)
    assert "names fly" in finding.sentence
