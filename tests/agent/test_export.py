"""Sessions as pages, JSON and run folders, from a folder and from a database."""

import json
import re
from contextlib import closing
from pathlib import Path

import pytest
from formup.agent.agent import Agent
from formup.agent.export import export_folder, export_json, export_page
from formup.agent.messages import Call, Reply
from formup.agent.service import Service
from formup.agent.session import Run, load_run
from formup.agent.store.places import store_at
from formup.agent.wrappers.doubles import ScriptedModel
from formup.apps.trace import show_trace
from formup.tools.context import Settings
from formup.tools.errors import InputError, StorageError
from formup.tools.perception.image import Picture, load_picture

ASK = Call(id="q", name="ask_user", arguments={"question": "How *many*?"})


@pytest.fixture(params=["sessions", "sqlite:///{}/sessions.db"])
def said(request: pytest.FixtureRequest, red_box: Picture, propose: Call, tmp_path: Path) -> Run:
    """A session of two turns: a question and a plan, then thanks."""
    address: str = request.param
    where = address.format(tmp_path) if "{" in address else str(tmp_path / address)
    store = store_at(where)
    tell = propose.model_copy(update={"arguments": propose.arguments | {"tell": "Six | there."}})
    replies = [Reply(calls=(ASK,)), Reply(calls=(tell,)), Reply(text="<b>You</b> are welcome.")]
    agent = Agent(ScriptedModel(replies))
    fixed = Settings(may_deploy=False)
    asked = agent.run(red_box, "Surround `it`", settings=fixed, trace=store.create())
    told = agent.resume(asked, answer="6")
    assert told.report.status == "planned"
    done = agent.say(told, "Thanks # a lot")
    request.addfinalizer(store.close)
    return done


def test_a_page_says_what_was_asked_and_shows_each_plan(said: Run, tmp_path: Path) -> None:
    assert said.stored is not None
    page = export_page(said.stored, tmp_path / "page").read_text()
    assert page.startswith(f"# Session {said.stored.id}\n\n200 x 140 px, scripted\n")
    order = [
        "## 1. Surround \\`it\\`",
        "> How \\*many\\*?\n>\n> **6**",
        f"pictures/{said.world.current}.png)",
        "planned: Six \\| there.",
        "## 2. Thanks \\# a lot",
        "answered: \\<b\\>You\\</b\\> are welcome.",
    ]
    places = [page.index(text) for text in order]
    assert places == sorted(places)
    shown = re.findall(r"!\[.*?\]\((.*?)\)", page)
    sizes = [load_picture(tmp_path / "page" / name).pixels.shape[:2] for name in shown]
    assert sizes[0] == (140, 200)
    assert min(sizes[1]) > 200


def test_a_session_in_which_nothing_was_said_is_its_picture(
    red_box: Picture, tmp_path: Path
) -> None:
    with closing(store_at(tmp_path / "sessions")) as store:
        session = store.open(Service(Agent(), store).open(red_box))
        page = export_page(session, tmp_path / "page").read_text()
        assert export_json(session, tmp_path / "page").is_file()
    assert page == (
        f"# Session {session.id}\n\n200 x 140 px, offline\n\n![start](pictures/start.png)\n"
    )


def test_a_folder_is_a_run_that_trace_reads_and_others_go_on_with(
    said: Run, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert said.stored is not None
    path = export_folder(said.stored, tmp_path / "copy")
    show_trace(tmp_path / "copy")
    assert "Surround `it`" in capsys.readouterr().out
    again = load_run(path)
    assert again.outcome == said.outcome
    assert again.stored is not None
    assert again.stored.events() == said.stored.events()
    more = Agent(ScriptedModel([Reply(text="Yes.")])).say(again, "Really?")
    assert more.report.message == "Yes."
    assert len(said.stored.events()) < len(again.stored.events())


def test_json_has_every_event_and_no_pictures(said: Run, tmp_path: Path) -> None:
    assert said.stored is not None
    content = json.loads(export_json(said.stored, tmp_path / "json").read_text())
    assert content["format"] == "formup-export-1"
    events = said.stored.events()
    assert [(e["n"], e["type"]) for e in content["events"]] == [(e.number, e.kind) for e in events]
    assert content["events"][1]["words"] == "Surround `it`"
    assert len(json.dumps(content)) < 40_000


def test_nothing_is_overwritten(said: Run, tmp_path: Path) -> None:
    assert said.stored is not None
    for export in (export_page, export_json, export_folder):
        path = export(said.stored, tmp_path / "out")
        before = path.read_bytes()
        with pytest.raises(StorageError, match="is there already and is not overwritten"):
            export(said.stored, tmp_path / "out")
        assert path.read_bytes() == before
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot be made"):
        export_page(said.stored, tmp_path / "file")
