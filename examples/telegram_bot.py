"""A team of robots behind Telegram: send a photo, say where they should stand, go on talking."""

import asyncio
from collections.abc import Awaitable
from os import getenv

import formup
from telegram import Chat, InlineKeyboardButton, InlineKeyboardMarkup, Message, Update, error
from telegram.ext import Application, CallbackQueryHandler, MessageHandler, filters


class Team:
    """Each chat is a session of the listed user who sent its first photo."""

    def __init__(self, service: formup.Service, users: set[int], settings: formup.Settings) -> None:
        self.service, self.users, self.settings = service, users, settings
        self.talks, self.stops = dict[int, tuple[str, int]](), dict[int, int]()

    async def close(self, _: object) -> None:
        """Let go of robots and store."""
        await self.service.close()

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
            if mine and (yes := str(query.data).split()):
                await self._answer(chat, self.service.approve(session, yes[0], yes[1]))

    async def _turn(self, message: Message, user: int) -> formup.Run | str:
        chat, words = message.chat_id, message.text or message.caption or ""
        if words.startswith("/"):  # /start comes of opening the chat; others may name the bot
            words = "" if words.startswith("/start") else words[1:].partition("@")[0]
        if formup.is_stop(words):
            self.stops[chat] = message.message_id
            if chat in self.talks:
                await self.service.stop(self.talks[chat][0])
            return "The robots are held where they are. Say what to change, or go to drive on."
        media = (message.photo[-1:] or (message.document,))[0] if user in self.users else None
        data = await (await media.get_file()).download_as_bytearray() if media else b""
        session, owner = self.talks.get(chat, ("", user))  # as it is now that the photo is here
        if user != owner or user not in self.users:
            return f"You are {user}; I do what others say here. Stop is for everybody."
        picture = formup.picture_from_bytes(bytes(data), "photo") if media else None
        done = "Send a photo, and words that say what to do."
        if picture and session:
            done = await self.service.image(session, picture)
        elif picture:
            session, _ = self.talks[chat] = self.service.open(picture, settings=self.settings), user
            done = "Now say what to do."
        if session and words and self.stops.get(chat, 0) < message.message_id:
            done = await self.service.say(session, words)
        return done

    async def _answer(self, chat: Chat, work: Awaitable[formup.Run | str]) -> None:
        try:
            done = await work
        except (formup.FormupError, error.TelegramError) as failed:
            done = str(failed)
        text, button = done if isinstance(done, str) else done.report.message, None
        if isinstance(done, formup.Run):
            if done.report.status != "answered" and (picture := await asyncio.to_thread(done.view)):
                await chat.send_photo(picture)
            if waits := await self.service.waits(self.talks[chat.id][0]):
                go = InlineKeyboardButton("Go", callback_data=f"{waits.plan_id} {waits.nonce}")
                button = InlineKeyboardMarkup([[go]])
        for start in range(0, len(text), 2048):  # of 4,096, of which some characters take two
            await chat.send_message(text[start : start + 2048], reply_markup=button)


def main() -> None:
    """Listen until interrupted, to all at once, so that stop waits for nobody."""
    token, users = getenv("TELEGRAM_TOKEN"), getenv("TELEGRAM_USERS", "").split(",")
    if not token or not all(map(str.isdigit, users)):
        raise SystemExit("Set TELEGRAM_TOKEN, and TELEGRAM_USERS to users' ids such as 123,456.")
    try:
        model, store = getenv("FORMUP_MODEL", "offline"), formup.store_at(getenv("FORMUP_STORE"))
        agent = formup.Agent(model, prompt=None if model == "offline" else "converse")
        settings = formup.Settings(fleet=getenv("FORMUP_FLEET", "simulated"))
        bot = Team(formup.Service(agent, store), set(map(int, users)), settings)
        server = getenv("TELEGRAM_SERVER", "https://api.telegram.org")
        made = Application.builder().token(token).concurrent_updates(True).post_shutdown(bot.close)
        app = made.base_url(f"{server}/bot").base_file_url(f"{server}/file/bot").build()
        app.add_handler(MessageHandler(filters.UpdateType.MESSAGE, bot.heard))
        app.add_handler(CallbackQueryHandler(bot.pressed))
        app.run_polling(drop_pending_updates=True)  # an old "go" must not move anybody
    except (formup.FormupError, error.TelegramError) as failed:
        raise SystemExit(str(failed)) from None


if __name__ == "__main__":
    main()
