"""Picture to candidates to masks to outlines, without learned weights."""

import os

# A camera that cannot be opened is one sentence of ours; it is read as cv2 is loaded.
os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")

import cv2

# A picture has the same mask on every processor: IPP's filters round otherwise where there is
# AVX-512. Segmenting takes no longer without them.
cv2.ipp.setUseIPP(False)
