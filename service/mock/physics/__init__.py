"""Dynamics of the simulated arm in real time: a servo moves it, obstacles resist."""
