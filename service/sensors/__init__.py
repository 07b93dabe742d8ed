"""Sensor sources: live clients and the alignment of their streams."""
