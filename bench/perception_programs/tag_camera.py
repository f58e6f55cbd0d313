"""A detector of AprilTags as users write one, with a pose for each."""

import cv2
import numpy as np


def prepare(seed):
    random = np.random.default_rng(seed)
    family = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_16h5)
    pictures = []
    for k in range(4):
        picture = np.full((400, 560), 170, dtype=np.uint8)
        for number in range(3):
            left, side = 40 + 170 * number, 50 + 20 * number + 5 * k
            picture[80 : 80 + side, left : left + side] = cv2.aruco.generateImageMarker(family, number, side)
        noise = random.normal(0.0, 4.0, picture.shape)
        pictures.append(np.clip(cv2.GaussianBlur(picture, (3, 3), 0) + noise, 0, 255).astype(np.uint8))
    return pictures


def run(pictures):
    family = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_16h5)
    detector = cv2.aruco.ArucoDetector(family)
    camera, still = np.array([[400.0, 0, 280], [0, 400.0, 200], [0, 0, 1.0]]), np.zeros(4)
    square = np.array([(-0.1, 0.1, 0), (0.1, 0.1, 0), (0.1, -0.1, 0), (-0.1, -0.1, 0)])
    total = 0.0
    for picture in pictures:
        corners, _, _ = detector.detectMarkers(picture)
        for one in corners:
            _, turn, place = cv2.solvePnP(square, one.reshape(4, 2), camera, still)
            total += float(cv2.Rodrigues(turn)[0][0, 0]) + float(place[2, 0])
    return total
