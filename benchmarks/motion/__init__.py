"""Contacts on moving arms, from simulated ground truth: who is found, how soon, how exactly."""
