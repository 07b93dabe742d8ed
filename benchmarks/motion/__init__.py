"""Contacts on moving arms, from simulated ground truth: detection rate, delay and accuracy."""
