"""What an answer makes of the words that were asked about.

It may choose an option, fill in what was left open, or be a command of its own.
"""

import re
from collections.abc import Sequence

from .correcting import amendments
from .followup import Followup
from .followups import commands, read_followup
from .options import agrees, option_at, option_named
from .standing import Standing

DEICTIC = re.compile(
    r"\b(?:(?:that|this|the|a|an)(?: one| other)? (?:robot|bot|drone|rover)|"
    r"(?:one|some|most|several|a few|a couple) of (?:the robots|them)|"
    r"over there|there|this one|that one|the other one|that|this)\b",
    re.IGNORECASE,
)
ROBOT = re.compile(
    r"^(?!some|most|several|a few|a couple).*(?:bot|drone|rover|them)", re.IGNORECASE
)
BESIDES = re.compile(
    r"^\W*(?:(?:sorry|oh|ah|well|um|uh|i mean(?:t)?|that would be|"
    r"that is|it'?s|let'?s say|say)\b[ ,.]*)+"
    r"|[ ,.]+(?:i mean(?:t)?|sorry|please|then|i think|i guess|of course)(?=\W*$)",
    re.IGNORECASE,
)
"""Words that come before or after an answer and say nothing."""
ALTERNATIVES = re.compile(
    r"\b(?:robots? |number )?(t?[0-9]+) or (?:robot |number )?t?[0-9]+\b", re.IGNORECASE
)
"""Alternatives that an answer chooses from: "robot 3 or 4"."""
LEADING = re.compile(r"\W*(?:(?:robot|number|nr|no)\.? )*(t?[0-9]+)\b[ ,.:]*(.*)", re.IGNORECASE)
"""The number that an answer begins with, and the rest of it."""
THING_ID = re.compile(r"\bt[0-9]+\b")
BARE_THING = re.compile(r"\W*(?:the|that|this|t[0-9]+)\b", re.IGNORECASE)


def words_meant(words: str, followup: Followup, answer: str, standing: Standing | None) -> str:
    """Return the words with an answer put in, or the answer alone if it is a command."""
    chosen = _chosen(answer, followup.options) or _naming(answer, followup.options, standing)
    if chosen:
        return chosen
    if standing and commands(answer, standing):
        return answer
    answer = BESIDES.sub("", answer) or answer
    named = option_named(answer, followup.options)
    if named is not None:
        return followup.options[named]
    amends = amendments(answer, words, standing) if standing else ()
    for attempt in (*_filled_in(words, answer), *amends, f"{words} {answer}", f"{answer} {words}"):
        if read_followup(attempt, standing).kind not in ("ask", "refuse", "instruction"):
            return attempt
    return answer


def _chosen(answer: str, options: Sequence[str]) -> str | None:
    """Return the option chosen by number, by rank, in full, or by yes to the only one."""
    at = option_at(answer, len(options))
    if at is not None or (len(options) == 1 and agrees(answer)):
        return options[at or 0]
    return answer if answer in options else None


def _filled_in(words: str, answer: str) -> list[str]:
    """Return the words with the answer in place of what they left open."""
    lead, either = LEADING.match(answer), ALTERNATIVES.search(words)
    shown = DEICTIC.search(words)
    if lead and either:
        return [f"{words[: either.start(1)]}{lead[1]}{words[either.end() :]} {lead[2]}"]
    if lead and shown and ROBOT.search(shown[0]):
        return [f"{DEICTIC.sub(f'robot {lead[1]}', words, count=1)} {lead[2]}"]
    return [DEICTIC.sub(answer, words, count=1)] if shown else []


def _naming(answer: str, options: Sequence[str], standing: Standing | None) -> str | None:
    """Return an option about the thing named, if the options differ only in their thing."""
    forms = {THING_ID.sub("{}", option) for option in options}
    if len(forms) != 1 or len(options) < 2 or not BARE_THING.match(answer):
        return None
    form, read = forms.pop(), read_followup(answer, standing)
    alone = [sorted(edit) for edit in read.edits] == [["kind", "to"]]
    return form.replace("{}", answer.strip(" .!")) if alone and form.count("{}") == 1 else None
