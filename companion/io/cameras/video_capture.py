"""OpenCV's VideoCapture as an iterator of frames; v4l2, gstreamer, rtsp differ in how they open it and trust its stamps."""

from __future__ import annotations

import time
from collections.abc import Iterator

import cv2

from companion.io.cameras.arrival import FIRST_PERIOD_NS, ArrivalStamps
from companion.io.cameras.frame import CameraError, CameraFrame, CaptureClock, as_image

MAX_STAMP_AGE_NS = 2_000_000_000
"""A driver's stamp older than this, or from the future, is on another clock or wrong."""

MISSES = 5
"""Reads in a row that may fail before the stream counts as ended."""


def live_frames(capture: cv2.VideoCapture, url: str, *, has_driver_stamps: bool) -> Iterator[CameraFrame]:
    """Frames of an open capture until it fails; releases it. CameraError where it was never open."""
    try:
        if not capture.isOpened():
            raise CameraError(f"{url}: cannot be opened")
        stamps = ArrivalStamps(_period_ns(capture))
        misses = 0
        while misses < MISSES:
            ok, pixels = capture.read()
            arrived_ns = time.monotonic_ns()
            image = as_image(pixels) if ok else None
            if image is None:
                misses += 1
                continue
            misses = 0
            driver_ns = round(capture.get(cv2.CAP_PROP_POS_MSEC) * 1e6) if has_driver_stamps else None
            captured_ns, uncertainty_ns = captured(driver_ns, arrived_ns, stamps)
            yield CameraFrame(image, captured_ns, uncertainty_ns, CaptureClock.MONOTONIC, arrived_ns)
    finally:
        capture.release()


def captured(driver_ns: int | None, arrived_ns: int, stamps: ArrivalStamps) -> tuple[int, int]:
    """The driver's stamp where it is one of this clock, else the guess from the arrival; with its uncertainty.

    Drivers stamp the start or the end of the frame and mostly do not say which: half a frame either way.
    """
    guess = stamps.stamp(arrived_ns)
    if driver_ns is not None and 0 <= arrived_ns - driver_ns <= MAX_STAMP_AGE_NS:
        return driver_ns, stamps.period_ns // 2
    return guess


def _period_ns(capture: cv2.VideoCapture) -> int:
    rate_hz = float(capture.get(cv2.CAP_PROP_FPS))
    return round(1e9 / rate_hz) if 1.0 <= rate_hz <= 1000.0 else FIRST_PERIOD_NS
