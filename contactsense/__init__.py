"""Estimate where a robot arm is touched from base force/torque sensor and joint torques.

Names are imported on first use (SPEC 1), so that `import contactsense` does not load a compiler.
"""

from typing import TYPE_CHECKING

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach(
    __name__,
    submodules=["kinematics", "robots", "service"],
    submod_attrs={
        "localizer": ["Localizer"],
        "output.batch": ["Batch"],
        "readings": ["Readings", "forward_model"],
        "sample_blocks": ["BlockEstimates", "SampleBlock"],
        "scene": [
            "FieldError",
            "JointTorqueSensor",
            "LinkWrenchSensor",
            "Scene",
            "SceneError",
            "WrenchSensor",
        ],
        "surface_map.detectability": ["Detectability", "detectability"],
        "types": ["Contact", "Estimate", "Event", "Explanation", "Sample"],
    },
)

if TYPE_CHECKING:
    from contactsense.localizer import Localizer as Localizer
    from contactsense.output.batch import Batch as Batch
    from contactsense.readings import Readings as Readings
    from contactsense.readings import forward_model as forward_model
    from contactsense.sample_blocks import BlockEstimates as BlockEstimates
    from contactsense.sample_blocks import SampleBlock as SampleBlock
    from contactsense.scene import FieldError as FieldError
    from contactsense.scene import JointTorqueSensor as JointTorqueSensor
    from contactsense.scene import LinkWrenchSensor as LinkWrenchSensor
    from contactsense.scene import Scene as Scene
    from contactsense.scene import SceneError as SceneError
    from contactsense.scene import WrenchSensor as WrenchSensor
    from contactsense.surface_map.detectability import Detectability as Detectability
    from contactsense.surface_map.detectability import detectability as detectability
    from contactsense.types import Contact as Contact
    from contactsense.types import Estimate as Estimate
    from contactsense.types import Event as Event
    from contactsense.types import Explanation as Explanation
    from contactsense.types import Sample as Sample
