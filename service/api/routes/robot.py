"""Routes for the arm and its scene."""

from math import isfinite

from fastapi import APIRouter

from contactsense.service.api import messages
from contactsense.service.api.messages import RobotOut, SceneOut
from contactsense.service.api.service import Shared

router = APIRouter()


@router.get("/v1/robot", summary="The arm")
async def robot(service: Shared) -> RobotOut:
    """The arm: links with mass and surface, joints with limits."""
    arm = service.scene.robot
    return RobotOut(
        name=arm.name,
        mass=arm.mass,
        links=[
            messages.LinkOut(
                name=link.name,
                mass=link.inertia.mass,
                com=link.inertia.com.tolist(),
                primitives=[primitive.model_dump(mode="json") for primitive in link.primitives],
            )
            for link in arm.links
        ],
        joints=[
            messages.JointOut(
                name=joint.name,
                position_limits=(_known(joint.position_limits[0]), _known(joint.position_limits[1])),
                velocity_limit=_known(joint.velocity_limit),
                torque_limit=_known(joint.torque_limit),
            )
            for joint in arm.joints
        ],
    )


def _known(limit: float) -> float | None:
    return limit if isfinite(limit) else None


@router.get("/v1/scene", summary="The arm in its cell")
async def scene(service: Shared) -> SceneOut:
    """The arm in its cell: mounting, tool, sensors and their noise."""
    here = service.scene
    return SceneOut(
        links=list(here.link_names),
        gravity_base=here.gravity_base.tolist(),
        scene=here.model_dump(mode="json"),
    )
