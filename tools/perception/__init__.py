"""From a picture to candidates, masks and outlines, by default without trained weights."""

import os

# We report a camera that cannot be opened in a sentence of our own. cv2 reads this as it loads.
os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")

import cv2

# IPP's filters round differently on processors with AVX-512; without them a picture has the same
# mask on every processor. Segmenting takes no longer without them.
cv2.ipp.setUseIPP(False)
