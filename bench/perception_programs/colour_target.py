"""A red landing spot in a colour picture: masks, morphology, contours."""

import cv2
import numpy as np


def prepare(seed):
    random = np.random.default_rng(seed)
    pictures = []
    for k in range(5):
        picture = random.integers(60, 140, (480, 640, 3), dtype=np.uint8)
        cv2.circle(picture, (100 + 80 * k, 240), 30, (20, 20, 230), -1)
        pictures.append(picture)
    return pictures


def run(pictures):
    found = 0
    kernel = np.ones((5, 5), np.uint8)
    for picture in pictures:
        small = cv2.resize(picture, (320, 240))
        grey = cv2.cvtColor(small, cv2.COLOR_BGR2GRAY)
        red = cv2.absdiff(small[:, :, 2].copy(), grey)
        mask = cv2.threshold(cv2.medianBlur(red, 5), 60, 255, cv2.THRESH_BINARY)[1]
        mask = cv2.dilate(cv2.erode(mask, kernel), kernel)
        contours, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
        found += len(contours) + cv2.countNonZero(mask)
    return found
