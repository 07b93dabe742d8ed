"""Drawings of arms and timelines, for reports and for a browser."""
