"""The bot itself, against a double of Telegram's Bot API: photos, words, buttons, stop."""

import json
import os
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from email import message_from_bytes
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from io import BytesIO
from pathlib import Path
from typing import Any, cast
from urllib.parse import parse_qsl, unquote

import pytest
from PIL import Image

ROOT = Path(__file__).parents[2]
PHOTOS = ROOT / "evals/photos"
TOKEN, ME, OTHER, STRANGER = "1:of-a-test", 7, 8, 99
PATIENCE = 60
COINS = "Surround the largest coin with 2 robots"
FLEET = """
import formup_example_fleet as carts

class Slow(carts.Carts):
    async def observe(self, *, max_age=None):
        poses = await super().observe(max_age=max_age)
        with open(r"{path}", "a") as file:
            print([(pose.x, pose.y) for pose in poses], file=file)
        return poses

    async def stop(self):
        await super().stop()
        await self.observe()

carts.SPEED = 60.0

def open_fleet(request):
    return Slow(request.size[0])
"""


class Telegram(BaseHTTPRequestHandler):
    """Answers as the Bot API does, and keeps what the bot sends."""

    def do_GET(self) -> None:
        token, _, name = unquote(self.path).removeprefix("/file/bot").partition("/")
        assert token == TOKEN
        cast("TelegramServer", self.server).held.wait(PATIENCE)
        self._send((PHOTOS / name).read_bytes())

    def do_POST(self) -> None:
        body = self.rfile.read(int(self.headers.get("content-length", 0)))
        fields = form(self.headers.get("content-type", ""), body)
        token, _, method = unquote(self.path).removeprefix("/bot").partition("/")
        if token != TOKEN:
            self._send(b'{"ok": false, "error_code": 401, "description": "Unauthorized"}', 401)
            return
        result = cast("TelegramServer", self.server).called(method, fields)
        self._send(json.dumps({"ok": True, "result": result}).encode())

    def _send(self, body: bytes, status: int = 200) -> None:
        self.send_response(status)
        self.send_header("content-length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, format: str, *args: Any) -> None:
        """Say nothing."""


def form(kind: str, body: bytes) -> dict[str, Any]:
    """Fields of a request; files as bytes."""
    if not kind.startswith("multipart/"):
        return dict(parse_qsl(body.decode()))
    parts = message_from_bytes(f"Content-Type: {kind}\r\n\r\n".encode() + body).get_payload()
    fields: dict[str, Any] = {}
    for part in cast("list[Any]", parts):
        data = part.get_payload(decode=True)
        name = part.get_param("name", header="content-disposition")
        fields[name] = data if part.get_filename() else data.decode()
    return fields


class TelegramServer(ThreadingHTTPServer):
    """A Bot API with its chats."""

    def __init__(self) -> None:
        super().__init__(("127.0.0.1", 0), Telegram)
        self.news, self.updates = threading.Condition(), list[dict[str, Any]]()
        self.sent: dict[int, list[dict[str, Any]]] = {}
        self.answers: dict[str, str] = {}
        self.number = 0
        self.polled, self.held = threading.Event(), threading.Event()
        self.held.set()

    def called(self, method: str, fields: dict[str, Any]) -> Any:
        """What a method returns."""
        if method == "getUpdates":
            return self._updates(int(fields.get("offset", 0)))
        if method == "getMe":
            return {"id": 1, "is_bot": True, "first_name": "Team", "username": "team_bot"}
        if method == "getFile":
            return {"file_id": "f", "file_unique_id": "f", "file_path": fields["file_id"]}
        with self.news:
            if method == "answerCallbackQuery":
                self.answers[fields["callback_query_id"]] = fields.get("text", "")
            elif method in ("sendMessage", "sendPhoto"):
                self.sent.setdefault(int(fields["chat_id"]), []).append(fields)
            self.news.notify_all()
        sent = {"message_id": 1, "date": 0, "chat": {"id": 1, "type": "private"}}
        return sent if method.startswith("send") else True

    def _updates(self, offset: int) -> list[dict[str, Any]]:
        with self.news:
            self.polled.set()
            if offset >= 0:
                self.updates = [u for u in self.updates if u["update_id"] >= offset]
            if not self.updates:
                self.news.wait(0.2)
            return list(self.updates)

    def add(self, **what: Any) -> int:
        """Something a person did."""
        with self.news:
            self.number += 1
            self.updates.append({"update_id": self.number, **what})
            self.news.notify_all()
            return self.number

    def wait(self, until: Callable[[], Any], why: str) -> Any:
        """What there is once it is there."""
        with self.news:
            assert self.news.wait_for(until, PATIENCE), why
            return until()


def person(user: int) -> dict[str, Any]:
    return {"id": user, "is_bot": False, "first_name": f"U{user}"}


class Chat:
    """A chat as the people in it use it."""

    def __init__(self, server: TelegramServer, number: int) -> None:
        self.server, self.number, self.read = server, number, 0

    def say(self, words: str = "", photo: str | None = None, user: int = ME) -> None:
        """Send a message."""
        number = self.server.number + 1
        message: dict[str, Any] = {"message_id": number, "date": 0, "from": person(user)}
        message["chat"] = {"id": self.number, "type": "group", "title": "G"}
        size = {"file_unique_id": "u", "width": 90, "height": 90}
        if photo is not None:
            ids = ("no such small one", photo)
            message |= {"caption": words, "photo": [{"file_id": i, **size} for i in ids]}
        else:
            message["text"] = words
        self.server.add(message=message)

    def press(self, button: str, user: int = ME) -> str:
        """Press a button; what is flashed."""
        chat = {"id": self.number, "type": "group", "title": "G"}
        message = {"message_id": 1, "date": 0, "chat": chat}
        query = f"q{self.server.number}"
        facts = {"id": query, "from": person(user), "chat_instance": "c", "data": button}
        self.server.add(callback_query={**facts, "message": message})
        return self.server.wait(
            lambda: (
                self.server.answers.get(query, False) is not False
                and (self.server.answers[query] or " ")
            ),
            "no answer to a button",
        )

    def next(self) -> dict[str, Any]:
        """What the bot sends next."""
        sent = self.server.sent.setdefault(self.number, [])
        self.server.wait(lambda: len(sent) > self.read, "the bot sends nothing")
        self.read += 1
        return sent[self.read - 1]

    def text(self) -> str:
        """The next text, after any picture."""
        sent = self.next()
        return sent["text"] if "text" in sent else self.text()

    def told(self, words: str, photo: str | None = None, user: int = ME) -> str:
        """Say something; the text that comes back."""
        self.say(words, photo, user)
        return self.text()


@pytest.fixture(scope="module")
def home(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder where a package with a fleet that counts as real is installed."""
    folder = tmp_path_factory.mktemp("bot")
    packages = folder / "packages"
    (packages / "carts-1.dist-info").mkdir(parents=True)
    facts = {
        "METADATA": "Metadata-Version: 2.1\nName: carts\nVersion: 1\n",
        "entry_points.txt": "[formup.fleets]\ncarts = slow_carts:open_fleet\n",
    }
    for name, text in facts.items():
        (packages / "carts-1.dist-info" / name).write_text(text)
    example = ROOT / "examples/formup_example_fleet/formup_example_fleet.py"
    (packages / example.name).write_bytes(example.read_bytes())
    (packages / "slow_carts.py").write_text(FLEET.format(path=folder / "seen.txt"))
    return folder


def started(home: Path, server: TelegramServer, **variables: str) -> subprocess.Popen[str]:
    path = os.pathsep.join([str(home / "packages"), os.environ.get("PYTHONPATH", "")])
    environment = os.environ | {
        "PYTHONPATH": path,
        "FORMUP_STORE": str(home / "sessions"),
        "TELEGRAM_TOKEN": TOKEN,
        "TELEGRAM_USERS": f"{ME},{OTHER}",
        "TELEGRAM_SERVER": f"http://127.0.0.1:{server.server_address[1]}",
    }
    command = [sys.executable, "-W", "error", str(ROOT / "examples/telegram_bot.py")]
    return subprocess.Popen(
        command, env=environment | variables, cwd=home, stderr=subprocess.PIPE, text=True
    )


@pytest.fixture(scope="module")
def server(home: Path) -> Iterator[TelegramServer]:
    """A Bot API with the bot behind it, whose robots count as real."""
    with TelegramServer() as made:
        threading.Thread(target=made.serve_forever, args=(0.01,)).start()
        bot = started(home, made, FORMUP_FLEET="carts")
        try:
            assert made.polled.wait(PATIENCE)
            yield made
        finally:
            bot.send_signal(signal.SIGINT)
            _, said = bot.communicate(timeout=PATIENCE)
            made.shutdown()
        assert (bot.returncode, said) == (0, "")


@pytest.fixture
def chat(server: TelegramServer) -> Chat:
    """A new chat."""
    return Chat(server, 1000 + server.add())


def button(sent: dict[str, Any]) -> str:
    (((only,),),) = (json.loads(sent["reply_markup"])["inline_keyboard"],)
    return only["callback_data"]


def seen(home: Path) -> list[str]:
    """Poses of the carts, each time that they were looked at."""
    file = home / "seen.txt"
    return file.read_text().splitlines() if file.exists() else []


def test_a_photo_with_words_comes_back_as_text_and_a_small_picture(chat: Chat) -> None:
    assert "Send a photo" in chat.told("/start")
    chat.say(COINS, "images/us_coins.jpg")
    picture = Image.open(BytesIO(chat.next()["photo"]))
    assert (picture.format, max(picture.size) < 1200) == ("JPEG", True)
    assert "2 robots" in chat.text()
    assert "2 robots" in chat.told("a bit further out")


def test_a_question_comes_with_its_candidates_and_is_answered(chat: Chat) -> None:
    chat.say("Surround the coin with 2 robots", "images/us_coins.jpg")
    assert Image.open(BytesIO(chat.next()["photo"])).format == "JPEG"
    assert chat.text().count("?")
    assert "2 robots" in chat.told("1")


def test_real_robots_move_at_the_button_of_that_very_plan_pressed_by_its_owner(
    chat: Chat, home: Path
) -> None:
    chat.told(COINS, "images/us_coins.jpg")
    asked = chat.told("go")
    assert "must approve" in asked
    first = button(chat.server.sent[chat.number][-1])
    before = seen(home)
    assert "Only the one whose photo" in chat.press(first, user=OTHER)
    assert "what others say" in chat.told("yes", user=OTHER)
    chat.told("a bit further out")
    chat.told("go")
    second = button(chat.server.sent[chat.number][-1])
    assert second != first
    chat.press(first)
    assert f"{first.split()[0]} cannot be approved" in chat.text()
    assert len({*seen(home)[len(before) :]}) <= 1, "nobody has moved"
    chat.press(second)
    assert "arrived" in chat.text()
    chat.press(second)
    assert "no plan waits" in chat.text()


def test_stop_holds_robots_at_once_while_a_turn_runs(chat: Chat, home: Path) -> None:
    chat.told(COINS, "images/us_coins.jpg")
    chat.told("go")
    begun = len(seen(home))
    chat.press(button(chat.server.sent[chat.number][-1]))
    until = time.monotonic() + PATIENCE
    while len({*seen(home)[begun:]}) < 10:
        assert time.monotonic() < until, "nobody moves"
        time.sleep(0.01)
    assert "under way" in chat.told("a bit further out")
    told = {chat.told("/stop@team_bot", user=STRANGER), chat.text()}
    assert any("held where they are" in text for text in told)
    assert not any("arrived" in text for text in told)
    held, looked = seen(home)[-1], len(seen(home))
    time.sleep(0.3)
    assert "held where they are" in chat.told("Stop!")
    assert len(seen(home)) > looked
    assert set(seen(home)[looked:]) == {held}, "nobody moves on"


def test_chats_are_sessions_of_their_own(server: TelegramServer, chat: Chat) -> None:
    other = Chat(server, chat.number + 5000)
    chat.told(COINS, "images/us_coins.jpg")
    other.told("Surround it with 2 robots", "images/cars_two.jpg", user=OTHER)
    assert "Send a photo" in Chat(server, chat.number + 6000).told("go")
    assert "2 robots" in chat.told("a bit further out")


def test_who_is_not_listed_is_told_who_they_are(chat: Chat) -> None:
    assert f"You are {STRANGER}" in chat.told(COINS, "images/us_coins.jpg", user=STRANGER)


def test_what_is_no_picture_is_one_sentence(chat: Chat) -> None:
    assert "not a picture of an allowed format" in chat.told(COINS, "LICENSES.md")


@pytest.mark.parametrize(
    "variables", [{"TELEGRAM_TOKEN": ""}, {"TELEGRAM_USERS": ""}, {"TELEGRAM_USERS": "me,7"}]
)
def test_without_a_token_or_users_it_says_what_to_set(
    variables: dict[str, str], home: Path
) -> None:
    with TelegramServer() as server:
        bot = started(home, server, **variables)
        _, said = bot.communicate(timeout=PATIENCE)
    assert bot.returncode == 1
    assert re.fullmatch("Set TELEGRAM_TOKEN, .*\n", said)


def test_what_it_cannot_begin_with_is_one_sentence(home: Path) -> None:
    with TelegramServer() as server:
        bot = started(home, server, FORMUP_MODEL="nobody:x")
        _, said = bot.communicate(timeout=PATIENCE)
    assert (bot.returncode, said.count("\n")) == (1, 1)
    assert said.startswith("Unknown model 'nobody:x'")


def test_a_token_that_is_refused_ends_it(home: Path, server: TelegramServer) -> None:
    bot = started(home, server, TELEGRAM_TOKEN="2:of-another")
    _, said = bot.communicate(timeout=PATIENCE)
    assert bot.returncode == 1
    assert said.splitlines()[-1].endswith("was rejected by the server.")


def test_stop_counts_for_a_photo_that_is_still_on_its_way(chat: Chat) -> None:
    chat.server.held.clear()
    chat.say(f"{COINS} and go", "images/us_coins.jpg")
    assert "held where they are" in chat.told("stop")
    chat.server.held.set()
    assert chat.text() == "Now say what to do.", "its words are void"
    assert "2 robots" in chat.told(COINS)


def test_of_two_whose_photos_come_together_the_chat_is_ones(chat: Chat) -> None:
    chat.server.held.clear()
    chat.say(COINS, "images/us_coins.jpg")
    chat.say(COINS, "images/us_coins.jpg", user=OTHER)
    chat.server.held.set()
    refused, planned = sorted((chat.text(), chat.text()), key=lambda told: "You are" not in told)
    owner = OTHER if f"You are {ME}" in refused else ME
    assert "2 robots" in planned
    assert "2 robots" in chat.told("a bit further out", user=owner)


def test_a_later_photo_is_gone_on_with_once_something_was_said(chat: Chat) -> None:
    assert "say what to do" in chat.told("", "images/us_coins.jpg")
    assert "Say what to do first" in chat.told("", "images/cars_two.jpg")
    assert "2 robots" in chat.told(COINS)
    assert "photo from now on" in chat.told("", "images/cars_two.jpg")
