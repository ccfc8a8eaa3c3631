"""Files of prompts: what they must say, what their inputs take, what becomes of {{name}}."""

from collections.abc import Mapping
from pathlib import Path

import pytest
from formup.prompts import PromptError
from formup.prompts.prompt import VARIABLE, Prompt, parse_prompt
from hypothesis import given
from hypothesis import strategies as st

HEAD = "id: mine\nversion: 1\nsummary: For tests.\n"
words = st.from_regex(r"[a-z_][a-z0-9_]{0,8}", fullmatch=True)
letters = st.characters(blacklist_categories=["Cs", "Cc"])
plain = st.text(letters, min_size=1).filter(lambda t: bool(t.strip()) and not VARIABLE.search(t))
values: Mapping[str, st.SearchStrategy[object]] = {
    "string": st.text(letters),
    "integer": st.integers(-(2**62), 2**62),
    "number": st.floats(allow_nan=False, allow_infinity=False),
    "boolean": st.booleans(),
}
kinds = st.dictionaries(words, st.sampled_from(sorted(values)), min_size=1, max_size=5)


def no_partial(ref: str) -> str:
    raise AssertionError(ref)


def made(body: str, head: str = "", name: str = "mine@v001") -> Prompt:
    return parse_prompt(name, f"---\n{HEAD}{head}---\n{body}", no_partial)


def declared(inputs: Mapping[str, str]) -> str:
    lines = [f"  {name!r}: {{type: {kind}}}\n" for name, kind in inputs.items()]
    return "inputs:\n" + "".join(lines)


@given(plain)
def test_text_without_variables_is_told_as_it_is(text: str) -> None:
    assert made(text).render() == text.strip() + "\n"


@given(kinds, plain, st.data())
def test_a_rendered_text_holds_every_value_and_nothing_else_new(
    inputs: dict[str, str], text: str, data: st.DataObject
) -> None:
    given_ = {name: data.draw(values[kind]) for name, kind in inputs.items()}
    body = f"{text}." + "|".join(f"{{{{{name}}}}}" for name in inputs) + f".{text}."
    prompt = made(body, declared(inputs))
    written = [prompt.front.inputs[n].written(v) for n, v in given_.items()]
    assert prompt.render(given_) == f"{text.lstrip()}." + "|".join(written) + f".{text}.\n"


@given(kinds, words, st.data())
def test_names_that_are_no_input_and_missing_values_are_refused(
    inputs: dict[str, str], other: str, data: st.DataObject
) -> None:
    prompt = made("".join(f"{{{{{name}}}}}" for name in inputs), declared(inputs))
    given_ = {name: data.draw(values[kind]) for name, kind in inputs.items()}
    if other not in inputs:
        with pytest.raises(PromptError, match=f"no input {other!r}"):
            prompt.render(given_ | {other: 1})
    left_out = sorted(inputs)[0]
    del given_[left_out]
    with pytest.raises(PromptError, match=f"{left_out} .* is missing"):
        prompt.render(given_)


def test_a_value_is_never_read_as_a_variable() -> None:
    prompt = made("{{a}} {{b}}", "inputs: {a: {type: string}, b: {type: string}}\n")
    assert prompt.render({"a": "{{b}}", "b": "<&>"}) == "{{b}} <&>\n"


ROBOTS = "inputs: {n: {type: integer, min: 1, max: 64, default: 4}}\n"
REFUSED = [
    ("{type: integer, min: 1}", 0, "0 is below 1"),
    ("{type: integer, max: 64}", 65, "65 is above 64"),
    ("{type: integer}", 2.0, "2.0 is no integer"),
    ("{type: integer}", True, "True is no integer"),
    pytest.param("{type: integer}", 10**5000, "is no integer", id="vast"),
    ("{type: number}", float("nan"), "nan is no number"),
    ("{type: number, max: 0.5}", 1, "1 is above 0.5"),
    ("{type: boolean}", 1, "1 is no boolean"),
    ("{type: string, max_chars: 3}", "four", "has 4 characters; 3 are allowed"),
    ("{type: string, enum: [red, blue]}", "green", "'green' is none of red, blue"),
    ("{type: string}", None, "None is no string"),
]


@pytest.mark.parametrize(("declaration", "value", "words"), REFUSED)
def test_values_outside_what_is_declared_are_refused(
    declaration: str, value: object, words: str
) -> None:
    prompt = made("{{n}}", f"inputs: {{n: {declaration}}}\n")
    with pytest.raises(PromptError, match="mine@v001 cannot be rendered") as refused:
        prompt.render({"n": value})
    assert words in str(refused.value)


def test_a_default_is_taken_where_no_value_is_given() -> None:
    assert made("{{n}} robots", ROBOTS).render() == "4 robots\n"
    assert made("{{n}} robots", ROBOTS).render({"n": 5}) == "5 robots\n"


BROKEN = [
    ("{{n}} and {{m}}", "", ("{{m}} is no input", "{{n}} is no input")),
    ("text", ROBOTS, ("n is declared but {{n}} is not in the text",)),
    ("text", "status: fine\n", ("status: Extra inputs are not permitted",)),
    ("text", "parent: x@1\ncreated: soon\n", ("parent:", "created:")),
    ("{{n}}", "inputs: {n: {type: integer, min: 3, default: 2}}\n", ("default 2 is below 3",)),
    ("{{n}}", "inputs: {n: {type: string, min: 3}}\n", ("min and max are for numbers",)),
    ("{{n}}", "inputs: {n: {type: integer, max_chars: 3}}\n", ("max_chars is for strings",)),
    ("{{n}}", "inputs: {n: {type: list}}\n", ("inputs.n.type",)),
    ("text", "inputs: {N: {type: string}}\n", ("inputs.N",)),
    ("{{on}}", "inputs: {on: {type: string}}\n", ("YAML reads on, yes, off and no as true",)),
    ("{{no}}", "inputs: {no: {type: string}}\n", ("put a name in quotes",)),
    ("text", "tools: [look\n", ("no YAML",)),
    ("text", "created: 2026-13-45\n", ("no YAML",)),
    (" \n ", "", ("it has no text",)),
]


@pytest.mark.parametrize(("body", "head", "words"), BROKEN)
def test_what_is_wrong_with_a_file_is_said_all_at_once(
    body: str, head: str, words: tuple[str, ...]
) -> None:
    with pytest.raises(PromptError, match="mine@v001") as refused:
        made(body, head)
    for word in words:
        assert word in str(refused.value)


def test_names_that_yaml_reads_as_truth_values_go_in_quotes() -> None:
    prompt = made("{{on}} {{no}}", declared({"on": "string", "no": "string"}))
    assert prompt.render({"on": "a", "no": "b"}) == "a b\n"


def test_a_file_must_be_what_its_place_says() -> None:
    with pytest.raises(PromptError, match=r"id is 'mine' but its folder 'other'.*file v002"):
        made("text", name="other@v002")
    with pytest.raises(PromptError, match="its version is 1 but its file draft-x"):
        made("text", name="mine@draft-x")
    with pytest.raises(PromptError, match="does not begin with front matter"):
        parse_prompt("mine@v001", "text alone", no_partial)


def test_the_example_of_the_docs_is_a_prompt() -> None:
    page = (Path(__file__).parents[2] / "docs/prompts.md").read_text("utf-8")
    source = page.split("```\n")[1]
    prompt = parse_prompt("rough@v002", source, lambda ref: "Pixels, y down.")
    assert prompt.render() == "Draw an outline of 8 vertices. Pixels, y down.\n"


def test_the_text_hash_is_of_the_text_and_the_file_hash_of_all() -> None:
    first, second = made("text"), made("text", "tags: [x]\n")
    assert first.sha256 == second.sha256
    assert first.file_sha256 != second.file_sha256
    assert made("other").sha256 != first.sha256


def test_partials_are_put_in_and_counted_in_the_hash() -> None:
    source = f"---\n{HEAD}include: [frame@v001]\n{ROBOTS}---\nPlace {{{{n}}}}. {{{{frame}}}}"

    def parsed(text: str) -> Prompt:
        return parse_prompt("mine@v001", source, {"frame@v001": text}.__getitem__)

    assert parsed("Pixels, y down.").render() == "Place 4. Pixels, y down.\n"
    assert parsed("Pixels, y down.").sha256 != parsed("Metres, y up.").sha256
    assert parsed("At most {{n}}.").render() == "Place 4. At most 4.\n"
    with pytest.raises(PromptError, match=r"\{\{frame\}\} is no input"):
        parsed("{{frame}}")  # a partial is put in once, and includes nothing
    with pytest.raises(PromptError, match="frame is declared but"):
        parse_prompt("mine@v001", source.replace("{{frame}}", ""), lambda ref: "x")
    with pytest.raises(PromptError, match="n is declared twice"):
        parse_prompt("mine@v001", source.replace("frame", "n"), lambda ref: "x")
