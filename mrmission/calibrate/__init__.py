"""The calibration experiment: courses that are sailed to measure what corners cost."""
