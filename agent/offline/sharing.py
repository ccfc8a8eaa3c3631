"""The question asked where robots with assigned places find no order in which to move."""

from ..messages import History, Result
from .choosing import Step, calls_in
from .options import agrees, declines

MAY_SHARE = "Shall the robots share the places among themselves? 1: yes; 2: no."


def shared(refused: Result, messages: History) -> Step | str:
    """Return the question or, after a yes, the edit with places shared; else the closing text."""
    why = str((refused.facts or {}).get("plain", refused.text))
    call = next(c for c in calls_in(messages) if c.id == refused.call_id)
    if all(edit["kind"] == "swap" for edit in call.arguments["edits"]):
        return f"Nothing was changed: {why}"  # with places shared, robots would not move
    later = messages[messages.index(refused) + 1 :]
    answers = (m.text for m in later if isinstance(m, Result) and m.name == "ask_user")
    answer = next(answers, None)
    if answer is None:
        return Step("ask_user", {"question": f"{why} {MAY_SHARE}"})
    if agrees(answer) or answer.strip(" .") == "1":
        return Step("edit_formation", call.arguments | {"share": True})
    if declines(answer) or answer.strip(" .") == "2":
        return "Nothing was changed, as you said no."
    return f'Nothing was changed: "{answer}" does not say whether robots may share the places.'
