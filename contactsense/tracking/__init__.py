"""Tracking: one contact over time."""
