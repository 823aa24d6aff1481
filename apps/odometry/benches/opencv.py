"""Stereo visual odometry of the plain kind by OpenCV, on one thread: ORB, matches by Hamming distance, PnP with RANSAC, from pair to pair.

Reads from the folder argv[1] `pairs.txt`, a line `width height focal row column baseline count` (pixels, metres), and beside it rectified pairs I.left and I.right,
grey bytes row by row. Prints a line `version …`, then for each pair `x y z qx qy qz qw`, where the left camera is in the frame of the first one, and at the end
`milliseconds`, the CPU time of all, without reading. A pair in which fewer than 6 points agree is where the one before it was, and is counted: `lost count`.
"""
import sys
import time

import cv2
import numpy as np

folder = sys.argv[1]
words = open(f"{folder}/pairs.txt").read().split()
width, height, count = int(words[0]), int(words[1]), int(words[6])
focal, row, column, baseline = map(float, words[2:6])
camera = np.array([[focal, 0, column], [0, focal, row], [0, 0, 1]])
cv2.setNumThreads(1)
cv2.setRNGSeed(1)
orb = cv2.ORB_create(1000)
matcher = cv2.BFMatcher(cv2.NORM_HAMMING, crossCheck=True)


def refined(image, points):
    """Columns and rows to a part of a pixel: ORB's are whole pixels of its levels."""
    corners = np.array([point.pt for point in points], np.float32).reshape(-1, 1, 2)
    criteria = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 20, 0.01)
    return cv2.cornerSubPix(image, corners, (5, 5), (-1, -1), criteria).reshape(-1, 2).astype(float)


def features(left, right):
    """Descriptors, pixels and points of what both images show in one row."""
    (points, described), (others, other) = (orb.detectAndCompute(image, None) for image in (left, right))
    if described is None or other is None:
        return np.zeros((0, 32), np.uint8), np.zeros((0, 2)), np.zeros((0, 3))
    rows = []
    ours, theirs = (refined(image, found) for image, found in ((left, points), (right, others)))
    for match in matcher.match(described, other):
        (x, y), (x2, y2) = ours[match.queryIdx], theirs[match.trainIdx]
        if abs(y - y2) <= 2 and 1 <= x - x2 <= 128:
            depth = focal * baseline / (x - x2)
            rows.append((match.queryIdx, x, y, (x - column) * depth / focal, (y - row) * depth / focal, depth))
    table = np.array(rows, np.float64).reshape(-1, 6)
    return described[table[:, 0].astype(int)], table[:, 1:3], table[:, 3:6]


def quaternion(turn):
    """x, y, z, w."""
    axis = cv2.Rodrigues(turn)[0].ravel()
    angle = np.linalg.norm(axis)
    return (*(axis / max(angle, 1e-12) * np.sin(angle / 2)), np.cos(angle / 2))


print("version", cv2.__version__)
pose, last, spent, lost = np.eye(4), None, 0.0, 0
for i in range(count):
    left, right = (np.fromfile(f"{folder}/{i}.{side}", np.uint8).reshape(height, width) for side in ("left", "right"))
    start = time.thread_time()
    now = features(left, right)
    if last is not None:
        matches = matcher.match(last[0], now[0]) if len(last[0]) and len(now[0]) else []
        found, inliers = False, None
        if len(matches) >= 6:
            space = last[2][[match.queryIdx for match in matches]]
            image = now[1][[match.trainIdx for match in matches]]
            found, turn, shift, inliers = cv2.solvePnPRansac(space, image, camera, None, iterationsCount=200, reprojectionError=2.0)
        if found and inliers is not None and len(inliers) >= 6:
            inliers = inliers.ravel()
            turn, shift = cv2.solvePnPRefineLM(space[inliers], image[inliers], camera, None, turn, shift)
            now_from_last = np.eye(4)
            now_from_last[:3, :3], now_from_last[:3, 3] = cv2.Rodrigues(turn)[0], shift.ravel()
            pose = pose @ np.linalg.inv(now_from_last)
        else:
            lost += 1
    last = now
    spent += time.thread_time() - start
    print(*pose[:3, 3], *quaternion(pose[:3, :3]))
print("lost", lost)
print("milliseconds", spent * 1e3)
