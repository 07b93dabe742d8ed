"""Localization: where on the surface of each link a wrench enters, and how probable that is."""
