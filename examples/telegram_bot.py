"""A team of robots behind Telegram: send a photo, say where they should stand, go on talking."""

import asyncio
import os
from collections.abc import Awaitable

import formup
from telegram import Chat, InlineKeyboardButton, InlineKeyboardMarkup, Message, Update
from telegram.error import TelegramError
from telegram.ext import Application, CallbackQueryHandler, MessageHandler, filters


class TeamBot:
    """Each chat is a session of the listed user who sent its first photo."""

    def __init__(self, service: formup.Service, users: set[int], fleet: str) -> None:
        self.service, self.users, self.settings = service, users, formup.Settings(fleet=fleet)
        self.talks: dict[int, tuple[str, int]] = {}
        self.stopped: set[int] = set()

    async def heard(self, update: Update, _: object) -> None:
        """Answer a message."""
        if (message := update.message) and (user := update.effective_user):
            await self._answer(message.chat, self._turn(message, user.id))

    async def pressed(self, update: Update, _: object) -> None:
        """Approve the very plan that a button is for."""
        if (query := update.callback_query) and (chat := update.effective_chat):
            session, owner = self.talks.get(chat.id, ("", None))
            mine = query.from_user.id == owner
            await query.answer(None if mine else "Only the one whose photo it is can approve this.")
            if mine:
                await self._answer(chat, self.service.approve(session, str(query.data)))

    async def _turn(self, message: Message, user: int) -> formup.Run | str:
        chat, words = message.chat_id, message.text or message.caption or ""
        done = "Send a photo, and say what to do, such as: surround the largest coin with 6 robots."
        if words.startswith("/"):  # /start comes of opening the chat; others may name the bot
            words = "" if words.startswith("/start") else words[1:].partition("@")[0]
        session, owner = self.talks.get(chat, ("", user))
        if formup.is_stop(words):
            self.stopped.add(chat)
            if session:
                await self.service.stop(session)
            return "The robots are held where they are. Say what to change, or go to drive on."
        if user != owner or user not in self.users:
            return f"You are {user}; I do what others say here. Stop is for everybody."
        if media := message.photo[-1] if message.photo else message.document:
            self.stopped.discard(chat)
            data = bytes(await (await media.get_file()).download_as_bytearray())
            picture = formup.picture_from_bytes(data, "photo")
            if chat in self.stopped:
                return "Stopped before your photo was here; send it again."
            if session and self.service.session(session).run is not None:
                done = await self.service.image(session, picture)
            else:
                session, done = self.service.open(picture, settings=self.settings), "Now say what."
                self.talks[chat] = session, user
        return await self.service.say(session, words) if session and words else done

    async def _answer(self, chat: Chat, work: Awaitable[formup.Run | str]) -> None:
        try:
            done = await work
        except (formup.FormupError, TelegramError) as error:
            done = str(error)
        text, button = str(done), None
        if isinstance(done, formup.Run):
            text, status, plan = done.report.message, done.report.status, done.report.plan_id
            if status != "answered" and (picture := await asyncio.to_thread(done.view)):
                await chat.send_photo(picture)
            if status == "needs_approval" and plan:
                button = InlineKeyboardMarkup([[InlineKeyboardButton("Go", callback_data=plan)]])
        for start in range(0, len(text), 2048):  # of 4,096, of which some characters take two
            await chat.send_message(text[start : start + 2048], reply_markup=button)


def main() -> None:
    """Listen until interrupted, to all at once, so that stop waits for nobody."""
    env = os.environ.get
    token, users = env("TELEGRAM_TOKEN"), env("TELEGRAM_USERS", "").split(",")
    if not token or not all(map(str.isdigit, users)):
        raise SystemExit("Set TELEGRAM_TOKEN, and TELEGRAM_USERS to users' ids such as 123,456.")
    agent = formup.Agent(env("FORMUP_MODEL", "offline"))
    service = formup.Service(agent, formup.store_at(env("FORMUP_STORE")))
    bot = TeamBot(service, set(map(int, users)), env("FORMUP_FLEET", "simulated"))

    async def close(_: object) -> None:
        await service.close()

    server = env("TELEGRAM_SERVER", "https://api.telegram.org")
    builder = Application.builder().token(token).concurrent_updates(True).post_shutdown(close)
    app = builder.base_url(f"{server}/bot").base_file_url(f"{server}/file/bot").build()
    app.add_handler(MessageHandler(filters.UpdateType.MESSAGE, bot.heard))
    app.add_handler(CallbackQueryHandler(bot.pressed))
    app.run_polling(drop_pending_updates=True)  # an old "go" must not move anybody


if __name__ == "__main__":
    main()
