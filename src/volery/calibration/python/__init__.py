"""Times of Python's operations on the machine at hand: ``volery calibrate python``."""
