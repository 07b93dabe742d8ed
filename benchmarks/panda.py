"""The Panda as an arm by URDF, with a surface that was fitted to its visual meshes."""

from importlib import metadata
from pathlib import Path

from contactsense import JointTorqueSensor, Scene, robots
from contactsense.robots import Robot
from contactsense.robots.extras import install_command
from contactsense.robots.yaml_schema import with_surface
from contactsense.scene import LinkPrior

DRIFT = (0.2, 0.2, 0.1, 0.05, 0.02, 0.01, 0.01)
"""Standard deviation of the change of each joint's external torque over seconds without contact [Nm]: that of
the baselines of all published recordings. The controller's signal is low-passed; its white noise is far
below that."""
SURFACE = Path(__file__).parent / "panda.surface.yaml"
_PACKAGE = "example-robot-data"


class NoPandaError(RuntimeError):
    """The URDF of the Panda is not installed; the message names the remedy."""


def urdf() -> Path:
    """The URDF in the package `example-robot-data` of the extra `panda`.

    Raises:
        NoPandaError: the package is not installed.
    """
    try:
        files = metadata.files(_PACKAGE) or []
    except metadata.PackageNotFoundError:
        raise NoPandaError(f"the package {_PACKAGE} is not installed: {install_command('panda')}") from None
    return next(Path(str(file.locate())) for file in files if file.name == "panda.urdf")


def load() -> Robot:
    """Kinematics and inertia from the URDF, hand included; primitives from `SURFACE`."""
    return with_surface(robots.load(urdf()), SURFACE)


def scene(false_alarms_per_hour: float, link_prior: LinkPrior = "area") -> Scene:
    """The arm with its external joint torques alone. The base link cannot be touched: no joint measures it.

    Args:
        false_alarms_per_hour, link_prior: See `Scene`.
    """
    arm = load()
    return Scene(
        robot=arm,
        touchable=arm.link_names[1:],
        base_wrench=None,
        joint_torque=JointTorqueSensor(
            signal="external_torque",
            fields=tuple(f"tau_ext_{j}" for j in range(len(arm.joints))),
            noise=DRIFT,
        ),
        false_alarms_per_hour=false_alarms_per_hour,
        link_prior=link_prior,
    )
