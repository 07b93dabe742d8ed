"""Accuracy on static ground truth: errors, link decisions, probabilities."""
