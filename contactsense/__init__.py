"""Where is a robot arm being touched? Measurements in, contacts out."""

from contactsense.localizer import Batch, Localizer
from contactsense.scene import JointTorqueSensor, Scene, SceneError, WrenchSensor
from contactsense.types import Contact, Estimate, Event, Explanation, Sample

__all__ = [
    "Batch",
    "Contact",
    "Estimate",
    "Event",
    "Explanation",
    "JointTorqueSensor",
    "Localizer",
    "Sample",
    "Scene",
    "SceneError",
    "WrenchSensor",
]
