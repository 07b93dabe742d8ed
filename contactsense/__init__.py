"""Where is a robot arm being touched? Measurements in, contacts out."""

from contactsense.types import Contact, Estimate, Sample

__all__ = ["Contact", "Estimate", "Sample"]
