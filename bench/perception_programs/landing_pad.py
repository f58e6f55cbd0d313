"""A landing pad with two markers, seen from six heights."""

import cv2
import numpy as np

from volery.autonomy.markers import CameraModel, MarkerFinder


def prepare(seed):
    random = np.random.default_rng(seed)
    family = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    pad = np.full((600, 600), 200, dtype=np.uint8)
    pad[60:360, 60:360] = cv2.aruco.generateImageMarker(family, 3, 300)
    pad[420:540, 420:540] = cv2.aruco.generateImageMarker(family, 5, 120)
    pictures = []
    for scale in (0.9, 0.7, 0.5, 0.35, 0.25, 0.18):
        lawn = random.normal(110.0, 14.0, (480, 640)).astype(np.float32)
        lawn = cv2.GaussianBlur(lawn, (7, 7), 2.0)
        matrix = np.array(((scale, 0.1 * scale, 40.0), (-0.1 * scale, scale, 80.0)))
        seen = cv2.warpAffine(pad, matrix, (640, 480), dst=None, borderValue=0)
        pictures.append(np.where(seen > 0, seen, np.clip(lawn, 1, 255)).astype(np.uint8))
    return pictures


def run(pictures):
    camera = CameraModel(np.array(((500.0, 0.0, 320.0), (0.0, 500.0, 240.0), (0.0, 0.0, 1.0))), np.zeros(5))
    finder = MarkerFinder({3: 0.5, 5: 0.2})
    seen = 0
    for picture in pictures:
        seen += len(finder.find(picture, camera))
    return seen
