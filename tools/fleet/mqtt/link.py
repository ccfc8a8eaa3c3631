"""A connection to a broker that comes back by itself, with nothing left over but a hold.

Every connection is a client of its own: none repeats what an earlier one had to say. What was
retained is no news and never heard; what one says oneself is not heard either.
"""

import json
import os
import socket
import threading
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from ...errors import InputError

if TYPE_CHECKING:
    from paho.mqtt.client import Client, MQTTMessage

KEEP_ALIVE = 2
"""Seconds after which a link without traffic is tried out; the broker gives it up after 1.5 of
these, and then says the last will."""
AGAIN = 0.5
"""Seconds between tries to connect."""
CONNECTING = 5.0
MOST_BYTES = 65_536
"""Of a message; longer ones are not passed on by the broker."""
UNSPECIFIED = 128
"""The reason that the library gives where it knows none."""
EXPIRY = 1
"""Seconds for which a broker keeps what it cannot pass on."""

Heard = Callable[[str, bytes], None]


class Link:
    """Says and hears messages, in a thread of its own that calls back.

    It speaks and hears once it is started: what it calls must be set up before.

    Args:
        address: host, port, whether TLS is spoken; who logs in is in the environment.
        topics: what to listen to.
        heard: is given topic and payload of every message.
        will: topic and message that the broker says when this connection breaks, and whether it
            keeps it for those who come later.
        left: is called when the connection is lost.

    Attributes:
        joined: how often it has been connected.
        connected: whether it is now.
        trouble: why not, in words.

    Raises:
        InputError: the library is not installed, or the environment names no certificates.
    """

    def __init__(
        self,
        address: tuple[str, int, bool],
        topics: Iterable[str],
        heard: Heard,
        *,
        will: tuple[str, Mapping[str, Any], bool] | None = None,
        left: Callable[[], None] = lambda: None,
    ) -> None:
        self._address, self._topics, self._will = address, tuple(topics), will
        self._heard, self._left = heard, left
        self.joined, self.connected, self.trouble = 0, False, "it has not answered yet"
        self._unsaid: tuple[str, Mapping[str, Any]] | None = None
        self._ended, self._closed = threading.Event(), threading.Event()
        self._client = self._made()
        self._thread = threading.Thread(target=self._keep, daemon=True)

    def start(self) -> "Link":
        """Connect, and call back from now on."""
        self._thread.start()
        return self

    def say(
        self, topic: str, message: Mapping[str, Any], *, surely: bool = False, kept: bool = False
    ) -> None:
        """Send a message.

        Args:
            surely: it is sent later where it cannot be now.
            kept: the broker keeps it for those who come later.
        """
        if not self.connected:
            self._unsaid = (topic, message) if surely else self._unsaid
            return
        text = json.dumps(message, allow_nan=False)
        expiring = None if kept else self._expiring
        self._client.publish(topic, text, int(surely), kept, expiring)

    def close(self) -> None:
        """Say goodbye; what was said before still goes out."""
        self._closed.set()
        self._ended.set()
        self._thread.join(CONNECTING)

    def _keep(self) -> None:
        host, port, _ = self._address
        while not self._closed.is_set():
            try:
                self._client = client = self._made()
                client.connect(host, port, KEEP_ALIVE, clean_start=True, properties=self._small)
                client.loop_start()
                self._ended.wait()
                client.disconnect()
                client.loop_stop()
            except (OSError, ValueError, InputError) as error:
                self.trouble = getattr(error, "strerror", None) or str(error)
            self._closed.wait(AGAIN)
            self._ended.clear()

    def _made(self) -> "Client":
        try:
            from paho.mqtt.client import Client
            from paho.mqtt.enums import CallbackAPIVersion, MQTTProtocolVersion
            from paho.mqtt.packettypes import PacketTypes
            from paho.mqtt.properties import Properties
        except ImportError:
            raise InputError("Robots on MQTT need an extra: pip install 'formup[mqtt]'.") from None
        self._expiring = Properties(PacketTypes.PUBLISH)
        self._small = Properties(PacketTypes.CONNECT)
        self._expiring.MessageExpiryInterval = EXPIRY
        self._small.MaximumPacketSize = MOST_BYTES
        version = CallbackAPIVersion.VERSION2
        client = Client(version, protocol=MQTTProtocolVersion.MQTTv5, reconnect_on_failure=False)
        client.connect_timeout = CONNECTING
        if name := _environment("USERNAME"):
            client.username_pw_set(name, _environment("PASSWORD"))
        if self._address[2]:
            trusted, own, key = (_environment(word) for word in ("CA", "CERTIFICATE", "KEY"))
            try:
                client.tls_set(trusted, own, key)
            except (OSError, ValueError) as error:
                raise InputError(
                    "FORMUP_MQTT_CA, FORMUP_MQTT_CERTIFICATE and FORMUP_MQTT_KEY have to name PEM "
                    f"files: {getattr(error, 'strerror', None) or error}."
                ) from None
        if self._will is not None:
            topic, message, kept = self._will
            client.will_set(topic, json.dumps(message), 1, kept)
        client.on_connect, client.on_disconnect = self._came, self._went
        client.on_subscribe, client.on_message = self._listens, self._told
        client.on_socket_open = _undelayed
        return client

    def _came(self, client: "Client", data: Any, flags: Any, code: Any, more: Any) -> None:
        from paho.mqtt.subscribeoptions import SubscribeOptions

        if code.is_failure:
            self.trouble = f"it refuses: {code}"
            return
        for topic in self._topics:
            new = SubscribeOptions(qos=0, noLocal=True, retainHandling=2)
            client.subscribe(topic, options=new)
        self.joined += 1
        self.connected, self.trouble = True, ""
        if self._unsaid is not None:
            (topic, message), self._unsaid = self._unsaid, None
            self.say(topic, message, surely=True)

    def _listens(self, client: "Client", data: Any, mid: int, codes: Any, more: Any) -> None:
        if any(code.is_failure for code in codes):
            self.trouble = f"it does not let one listen: {codes[0]}"

    def _told(self, client: "Client", data: Any, message: "MQTTMessage") -> None:
        if not message.retain:
            self._heard(message.topic, bytes(message.payload))

    def _went(self, client: "Client", data: Any, flags: Any, code: Any, more: Any) -> None:
        if self.connected:
            self.connected, self.trouble = False, f"the connection broke{_cause(code)}"
            self._left()
        self._ended.set()


def _cause(code: Any) -> str:
    """Why a connection broke, after these words."""
    if code.value == UNSPECIFIED:
        return " without a word of the broker's"
    return f": {code}"


def _environment(word: str) -> str | None:
    """What the environment says of who logs in."""
    return os.environ.get(f"FORMUP_MQTT_{word}") or None


def _undelayed(client: Any, data: Any, sock: Any) -> None:
    """Small messages go out at once, not together with later ones."""
    with suppress(OSError, AttributeError):
        sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
