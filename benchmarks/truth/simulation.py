"""An arm in MuJoCo: its chain of links without shapes for the dynamics, or with shapes."""

from collections.abc import Callable

import mujoco
import numpy as np

from .arm import Arm, Link

GRAVITY = (0.0, 0.0, -9.81)
"""In base axes [m/s^2]: the arm stands upright."""
BASE = "base"
"""Where the wrench is sensed: the frame of the first link."""
SENSORS = ("force", "moment")
"""Of the wrench below the base, at the base origin."""


def dynamics(arm: Arm) -> mujoco.MjModel:
    """Masses and joints without geometry; force and moment are sensed below the base."""
    spec = _chain(arm, lambda _spec, _body, _link: None)
    for name, kind in zip(
        SENSORS, (mujoco.mjtSensor.mjSENS_FORCE, mujoco.mjtSensor.mjSENS_TORQUE), strict=True
    ):
        spec.add_sensor(name=name, type=kind, objtype=mujoco.mjtObj.mjOBJ_SITE, objname=BASE)
    return spec.compile()


def with_shapes(arm: Arm, add: Callable[[mujoco.MjSpec, mujoco.MjsBody, Link], None]) -> mujoco.MjModel:
    """The same joints with shapes.

    Args:
        arm: The arm.
        add: Gives a link's body its shapes; called once for each link.
    """
    return _chain(arm, add).compile()


def add_mesh(
    spec: mujoco.MjSpec,
    body: mujoco.MjsBody,
    name: str,
    vertices: np.ndarray,
    faces: np.ndarray | None,
    collides: bool,
) -> None:
    """A mesh in a body's frame.

    Args:
        spec, body: Where to.
        name: Unique name of the mesh.
        vertices: Shape (V, 3) [m].
        faces: Shape (F, 3); without them the mesh is the convex hull of the vertices.
        collides: Whether it takes part in collisions: as the convex hull.
    """
    # Open shells have no volume to take the mesh's own frame from.
    mesh = spec.add_mesh(name=name, inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL)
    mesh.uservert = vertices.ravel().tolist()
    if faces is not None:
        mesh.userface = faces.ravel().tolist()
    body.add_geom(
        type=mujoco.mjtGeom.mjGEOM_MESH, meshname=name, contype=int(collides), conaffinity=int(collides)
    )


def poses(model: mujoco.MjModel, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Origins, shape (N, n + 1, 3) [m], and rotations, shape (N, n + 1, 3, 3), of the link frames, base axes.

    Args:
        model: Any model of the arm.
        q: Joint positions, shape (N, n) [rad].
    """
    data = mujoco.MjData(model)
    origin, rotation = np.empty((len(q), model.nv + 1, 3)), np.empty((len(q), model.nv + 1, 3, 3))
    for i, posture in enumerate(q):
        data.qpos[:] = posture
        mujoco.mj_kinematics(model, data)
        origin[i], rotation[i] = data.xpos[1:], data.xmat[1:].reshape(-1, 3, 3)
    return origin, rotation


def _chain(arm: Arm, add: Callable[[mujoco.MjSpec, mujoco.MjsBody, Link], None]) -> mujoco.MjSpec:
    spec = mujoco.MjSpec()
    spec.modelname = arm.name
    spec.compiler.degree = False
    spec.option.gravity = GRAVITY
    body = spec.worldbody
    for j, link in enumerate(arm.links):
        body = body.add_body(
            name=f"link_{j}",  # a link's own name may be MuJoCo's, such as "world"
            pos=link.origin,
            quat=_quaternion(link.rotation),
        )
        # A base may be without mass: what does not move needs none.
        if link.mass > 0.0:
            body.mass, body.ipos, body.explicitinertial = link.mass, link.com, True
            body.fullinertia = link.tensor[(0, 1, 2, 0, 0, 1), (0, 1, 2, 1, 2, 2)]
        if j == 0:
            body.add_site(name=BASE)
        else:
            body.add_joint(name=f"joint_{j}", type=mujoco.mjtJoint.mjJNT_HINGE, axis=link.axis)
            spec.add_exclude(bodyname1=f"link_{j - 1}", bodyname2=f"link_{j}")
        add(spec, body, link)
    return spec


def _quaternion(rotation: np.ndarray) -> np.ndarray:
    quaternion = np.empty(4)
    mujoco.mju_mat2Quat(quaternion, rotation.ravel())
    return quaternion
