"""Disparities of OpenCV's block matching and semi-global matching, on one thread.

Reads from the folder argv[1] `pairs.txt`, a line `name width height levels` a pair, and beside it NAME.left and NAME.right, grey bytes row by
row. Writes NAME.MATCHER.disparity, 16-bit sixteenths of a pixel, and prints a line `name matcher milliseconds` for each: the least CPU
time of argv[2] turns.
"""
import sys
import time

import cv2
import numpy as np

folder, turns = sys.argv[1], int(sys.argv[2])
cv2.setNumThreads(1)


def block_matching(levels, speckle):
    matcher = cv2.StereoBM_create(levels, 7)
    matcher.setDisp12MaxDiff(1)
    matcher.setSpeckleWindowSize(speckle)
    matcher.setSpeckleRange(2)
    return matcher


def semi_global(levels, consistency, speckle):
    return cv2.StereoSGBM_create(
        0, levels, 5, P1=8 * 25, P2=32 * 25, disp12MaxDiff=consistency, preFilterCap=63, uniquenessRatio=0, speckleWindowSize=speckle,
        speckleRange=2, mode=cv2.STEREO_SGBM_MODE_SGBM_3WAY,
    )


MATCHERS = {
    "BM": lambda levels: block_matching(levels, 100),
    "SGBM-3way": lambda levels: semi_global(levels, 1, 100),
    "SGBM-3way-unchecked": lambda levels: semi_global(levels, -1, 0),
}

print("version", cv2.__version__, "0")
for line in open(f"{folder}/pairs.txt"):
    name, *numbers = line.split()
    width, height, levels = map(int, numbers)
    sides = [np.fromfile(f"{folder}/{name}.{side}", np.uint8).reshape(height, width) for side in ("left", "right")]
    # OpenCV matches no pixel whose whole search does not fit the right image: images are lengthened to the left.
    left, right = (cv2.copyMakeBorder(image, 0, 0, levels, 0, cv2.BORDER_REPLICATE) for image in sides)
    for kind, make in MATCHERS.items():
        matcher = make(levels)
        times = []
        for _ in range(turns):
            start = time.thread_time()
            disparity = matcher.compute(left, right)
            times.append(time.thread_time() - start)
        np.ascontiguousarray(disparity[:, levels:], np.int16).tofile(f"{folder}/{name}.{kind}.disparity")
        print(name, kind, min(times) * 1e3, flush=True)
