"""`python -m formup.benchmarks.bench_tracking`: accuracy and speed of visual tracking.

It runs on drawn video with known truth, 1000 x 750 px; overlap is the intersection over union of
the tracked and the true outline, in the frames in which the tracker says that it sees the thing.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from .drawn_video import Video
from .growth import show

SIZE = (1000, 750)
SEEDS = 2
CASES = {
    "moves": Video(),
    "turns": Video(speed=0, turn=2),
    "both": Video(turn=2),
    "both, noise 6": Video(turn=2, noise=6),
    "both, noise 6, textured floor": Video(turn=2, noise=6, floor="textured"),
    "six robots go along": Video(turn=2, robots="follow"),
    "six robots stay": Video(turn=2, robots="stay"),
    "40 % darker in the end": Video(turn=2, light=0.4),
    "a shadow passes": Video(turn=2, shadow=True),
    "blurred over 7 px": Video(turn=2, blur=7),
    "20 % covered for a third": Video(turn=2, covered=0.2),
    "covered for a third": Video(turn=2, covered=1.1),
    "leaves the picture": Video(turn=2, speed=8, leaves=True),
}


def rows() -> Iterator[str]:
    """Yield the table."""
    yield f"{'case':32}{'thing':10}{'mean':>7}{'worst':>7}{'seen':>7}{'CPU ms':>8}{'p95':>7}"
    for name, case in CASES.items():
        for look in ("textured", "coloured", "grey"):
            video = replace(case, look=look, size=SIZE)
            runs = [replace(video, seed=seed).follow() for seed in range(SEEDS)]
            frames = [seen for run in runs for seen in run]
            overlaps = [seen.overlap for seen in frames if not seen.tracked.lost]
            ms = [seen.ms for seen in frames]
            yield (
                f"{name:32}{look:10}{np.mean(overlaps):7.3f}{min(overlaps):7.3f}"
                f"{len(overlaps) / len(frames):7.0%}{np.median(ms):8.1f}"
                f"{np.percentile(ms, 95):7.1f}"
            )


if __name__ == "__main__":
    show(rows())
