"""Looks at robots elsewhere without telling them anything: who is there, and what is wrong."""

import time

from .fleet import Connection
from .poses import Poses, Track
from .settings import WireSettings
from .tagged import Judge, TagWatch, all_believed

CALMLY = 0.02
OFTEN = 3
"""So many messages of a robot have to come within `pose_timeout`: one may be lost."""


def checkup(
    settings: WireSettings,
    link: Connection,
    poses: Poses,
    others: set[str],
    seconds: float,
    guard: str,
    judge: Judge = all_believed,
) -> tuple[list[str], bool]:
    """What is to be told, and whether all could be driven, after listening for so many seconds.

    Args:
        link: listens, and feeds the poses where no camera does; is started, and closed after.
        others: robots that another program was heard to drive meanwhile.
        guard: how the link is guarded, in words.
        judge: what is believed of robots that a camera sees.
    """
    link.start()
    watch = settings.camera and TagWatch(settings.camera, poses, judge)
    where = f"{settings.where[0].upper()}{settings.where[1:]}"
    try:
        ends = time.monotonic() + seconds
        while not link.connected and time.monotonic() < ends:
            time.sleep(CALMLY)
        begun = time.monotonic()
        while link.connected and time.monotonic() < begun + seconds:
            time.sleep(CALMLY)
        if not link.connected or link.trouble:
            return [f"{where} is of no use: {link.trouble}."], False
    finally:
        link.close()
        if watch is not None:
            watch.close()
    now = time.monotonic()
    told = [f"{where} is reachable{guard}.{poses.trouble}"]
    robots = [_robot_told(settings, poses, robot, now, begun) for robot in settings.robots]
    told += [sentence for sentence, _ in robots]
    if poses.unknown:
        told.append(f"Robots that are not in the file speak too: {_few(poses.unknown)}.")
    if others:
        told.append(f"Another program is sending goals to robot {_few(others)}.")
    told.append(
        f"{settings.alone[0].upper()}{settings.alone[1:]}; "
        "that cannot be seen from here: try it out on each of them."
    )
    good = sum(fit for _, fit in robots)
    told.append(f"{good} of {len(robots)} robots can be driven.")
    return told, good == len(robots) and not others


def _robot_told(
    settings: WireSettings, poses: Poses, robot: str, now: float, begun: float
) -> tuple[str, bool]:
    """What is to be told of a robot, and whether it could be driven."""
    track, old = poses.tracks[robot], poses.old(now, settings.pose_timeout)
    refused = _not_believed(track)
    if robot in old or track.pose is None:
        return f"{old.get(robot, '')}{refused}", False
    if track.fault:
        return f"Robot {robot} cannot drive: {track.fault!r}.{refused}", False
    x, y = settings.frame.to_robots(track.pose.x, track.pose.y)
    rate, least = track.heard / max(now - begun, CALMLY), OFTEN / settings.pose_timeout
    seldom = f" That is too seldom: {least:.0f} times are needed." if rate < least else ""
    return (
        f"Robot {robot} was seen {poses.age(robot, now):.2f} s ago at ({x:.3f}, {y:.3f}), and "
        f"speaks {rate:.0f} times a second.{seldom}{refused}",
        not seldom,
    )


def _not_believed(track: Track) -> str:
    why = ", ".join(f"{n} {what}" for what, n in track.refused.most_common())
    return f" Of its {track.heard} messages some were refused: {why}." if why else ""


def _few(robots: set[str]) -> str:
    return ", ".join(sorted(robots)[:10])
