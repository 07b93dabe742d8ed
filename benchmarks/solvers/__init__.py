"""Accuracy and speed of the contact solvers: the tables of `docs/solvers.md`."""
