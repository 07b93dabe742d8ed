"""Benchmarks against ground truth and against yardsticks."""
