"""Who may listen and speak, what robots obey, and what a look at them tells."""

import subprocess
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from formup.tools.errors import InputError
from formup.tools.fleet.mqtt.checkup import checked
from outside import driven

Labs = Callable[..., Any]
Brokers = Callable[..., Any]


def told(found: tuple[list[str], bool]) -> str:
    return "\n".join(found[0])


def until(what: Callable[[], bool], seconds: float = 10.0) -> None:
    ends = time.monotonic() + seconds
    while not what():
        assert time.monotonic() < ends
        time.sleep(0.01)


def test_robots_hold_when_the_process_that_drives_them_is_killed(lab: Labs) -> None:
    there = lab(watchdog=10).simulate()
    with driven(there.path) as driver:
        until(lambda: there.named("driving") == {"a", "b", "c"})
        driver.kill()
    until(lambda: there.named("told to hold") == {"a", "b", "c"})  # the last will, not the watchdog
    time.sleep(0.3)
    held = there.robots.points.copy()
    time.sleep(0.3)
    assert abs(there.robots.points - held).max() < 0.5


def test_robots_obey_only_what_is_new_and_of_a_drive_that_goes_on(lab: Labs) -> None:
    there = lab().simulate()
    robot, link = there.robots.robots["a"], there.link()

    def say(**goal: Any) -> None:
        link.say(there.topic("goal", "a"), goal)

    say(drive="one", seq=5, x=90, y=50)
    until(lambda: robot.goal == (90, 50))
    for wrong in (
        {"drive": "one", "seq": 5, "x": 99, "y": 50},
        {"drive": "one", "seq": 4, "x": 99, "y": 50},
        {"drive": "one", "seq": "6", "x": 99, "y": 50},
        {"drive": "one", "seq": 7, "x": "far", "y": 50},
        {"seq": 8, "x": 99, "y": 50},
        {},
    ):
        say(**wrong)
    link.say(there.topic("goal", "nobody"), {"drive": "one", "seq": 9, "x": 1, "y": 1})
    say(drive="one", seq=10, x=91, y=50)
    until(lambda: robot.goal == (91, 50))
    link.say(there.topic("hold"), {})
    until(lambda: robot.goal is None)
    say(drive="one", seq=11, x=99, y=50)
    say(drive="two", seq=1, x=92, y=50)
    until(lambda: robot.goal == (92, 50))
    say(drive="one", seq=12, x=99, y=50)
    say(drive="two", seq=2, x=93, y=50)
    until(lambda: robot.goal == (93, 50))


def test_a_look_says_who_is_there_and_what_is_wrong(lab: Labs) -> None:
    there = lab(robots=["a", "b", "c", "d"], simulated={}).simulate()
    faults: dict[str, Callable[[dict[str, Any], int], object]] = there.robots.faults
    faults["b"] = lambda message, n: None
    faults["c"] = lambda message, n: message | {"fault": "emergency stop"}
    faults["d"] = lambda message, n: message | ({"x": "?"} if n % 2 else {})
    found = checked(there.settings, 1.0)
    assert not found[1]
    said = told(found)
    assert "is reachable, in the clear" in said
    assert "Robot a was seen 0." in said
    assert "Robot b not seen yet." in said
    assert "Robot c cannot drive: 'emergency stop'." in said
    assert "messages some were refused:" in said
    assert "malformed" in said
    assert "hold by themselves when no goal has come for 0.5 s; that cannot be seen" in said
    assert said.endswith("2 of 4 robots can be driven.")
    faults.clear()
    assert checked(there.settings, 1.0)[1]
    faults["a"] = lambda message, n: message if n % 5 == 0 else None
    found = checked(there.settings, 1.0)
    assert not found[1]
    assert "That is too seldom: 6 times are needed." in told(found)


def test_a_look_says_who_else_speaks(lab: Labs) -> None:
    there = lab().simulate()
    link = there.link()

    def beside(message: dict[str, Any], n: int) -> dict[str, Any]:
        link.say(there.topic("pose", "stranger"), message)
        link.say(there.topic("goal", "b"), message)
        return message

    there.robots.faults["a"] = beside
    found = checked(there.settings, 0.5)
    assert not found[1]
    assert "not in the file speak too: stranger." in told(found)
    assert "Another program is sending goals to robot b." in told(found)


def test_nobody_answers(lab: Labs, brokers: Brokers) -> None:
    broker = brokers()
    broker.kill()
    found = checked(lab(broker).settings, 0.3)
    assert (found[1], len(found[0])) == (False, 1)
    assert "of no use: Connection refused" in told(found)


@pytest.fixture(scope="module")
def certificates(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A certificate of 127.0.0.1 that nobody signed but itself, and its key."""
    folder = tmp_path_factory.mktemp("certificates")
    command = "openssl req -x509 -newkey rsa:2048 -nodes -days 2 -subj /CN=127.0.0.1"
    command += " -addext subjectAltName=IP:127.0.0.1 -keyout key.pem -out cert.pem"
    subprocess.run(command.split(), cwd=folder, check=True, capture_output=True)
    return folder


# paho leaves the socket of a handshake that failed to the garbage collector.
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_who_logs_in_is_said_by_the_environment_and_never_told(
    lab: Labs, brokers: Brokers, certificates: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    hashed = certificates / "passwords"
    command = ["mosquitto_passwd", "-b", "-c", str(hashed), "lab", "s3cret-w0rd"]
    subprocess.run(command, check=True, capture_output=True)
    files = f"certfile {certificates}/cert.pem\nkeyfile {certificates}/key.pem\n"
    broker = brokers(f"allow_anonymous false\npassword_file {hashed}\n{files}")
    broker.url = broker.url.replace("mqtt://", "mqtts://")
    settings = lab(broker).settings
    assert "certificate verify failed" in told(checked(settings, 0.5))
    monkeypatch.setenv("FORMUP_MQTT_CA", str(certificates / "cert.pem"))
    assert "refuses: Not authorized" in told(checked(settings, 0.5))
    monkeypatch.setenv("FORMUP_MQTT_USERNAME", "lab")
    monkeypatch.setenv("FORMUP_MQTT_PASSWORD", "wr0ng-word")
    refused = told(checked(settings, 0.5))
    assert "refuses: Not authorized" in refused and "wr0ng" not in refused
    monkeypatch.setenv("FORMUP_MQTT_PASSWORD", "s3cret-w0rd")
    found = told(checked(settings, 0.5))
    assert "is reachable over TLS, with a name to log in." in found
    assert "s3cret" not in found + repr(settings)
    monkeypatch.setenv("FORMUP_MQTT_CA", str(certificates / "none.pem"))
    with pytest.raises(InputError, match="have to name PEM files: No such file"):
        checked(settings, 0.5)
