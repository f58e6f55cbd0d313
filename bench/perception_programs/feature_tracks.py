"""Visual odometry over flat ground: corners, optical flow, a homography."""

import cv2
import numpy as np


def prepare(seed):
    random = np.random.default_rng(seed)
    stones = random.integers(0, 255, (90, 120), dtype=np.uint8)
    ground = cv2.resize(stones, (1000, 750), interpolation=cv2.INTER_CUBIC)
    return [np.ascontiguousarray(ground[4 * k : 4 * k + 240, 7 * k : 7 * k + 320]) for k in range(8)]


def run(pictures):
    total = 0.0
    before = cv2.GaussianBlur(pictures[0], (5, 5), 1.0)
    for picture in pictures[1:]:
        now = cv2.GaussianBlur(picture, (5, 5), 1.0)
        corners = cv2.goodFeaturesToTrack(before, 80, 0.02, 10)
        moved, status, _ = cv2.calcOpticalFlowPyrLK(before, now, corners, None)
        good = status.ravel() == 1
        matrix, _ = cv2.findHomography(corners[good], moved[good], cv2.RANSAC)
        total += matrix[0, 2]
        before = now
    return total
