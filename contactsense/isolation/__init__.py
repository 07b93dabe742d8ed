"""Isolation: one hypothesis per link, with the fused wrench and its evidence."""
