"""The scene as the kernels use it: everything about arm, tool, sensors and surface that does not change with
a sample."""

from typing import Annotated, NamedTuple

import numpy as np

from contactsense.detection.thresholds import STEPS, stream_thresholds
from contactsense.isolation.link_hypotheses import SensorModel
from contactsense.kinematics.model import Model
from contactsense.kinematics.wrench_transform import wrench_transform
from contactsense.localization.surface.local_prior import DeviationCells
from contactsense.localization.surface.mean_surface import with_deviations
from contactsense.localization.surface.surface_blocks import SurfaceBlocks, surface_blocks
from contactsense.localization.surface.surface_moments import SurfaceMoments
from contactsense.localization.surface.surface_samples import (
    SurfaceSamples,
    SurfaceSubsamples,
    sample_surface,
)
from contactsense.residuals.joint_friction import JointTorqueModel, joint_torque_model
from contactsense.robots.jit.declaration import Floats, Integers
from contactsense.robots.surface.convex_primitives import Surfaces
from contactsense.scene import Scene, SceneError
from contactsense.scene_model.arm_model import model_with_tool
from contactsense.scene_model.deviation_cells import deviation_cells
from contactsense.scene_model.left_out_links import left_out_links, unsearched_surfaces
from contactsense.scene_model.link_prior import area_share, link_probability, log_link_density
from contactsense.scene_model.link_sensors import LinkSensors, link_sensors, mounts
from contactsense.scene_model.reading_limits import ReadingLimits, reading_limits
from contactsense.scene_model.scene_surfaces import scene_surfaces, touchable_links
from contactsense.scene_model.unmodelled_places import unmodelled_places
from contactsense.sensors.settings import JointTorqueSensor, WrenchSensor, per_joint
from contactsense.solvers.posterior.contact_prior import Prior


class Constants(NamedTuple):
    """Constant arrays of the sample path, built once from a `Scene`."""

    model: Model
    """Kinematics and inertia, the tool joined to the last link."""
    surfaces: Surfaces
    """Touchable surface; the primitives of a tool are given in the frame of the last link. Primitives beyond
    `start[-1]` are those of bodies that cover it, base frame; their `link` is 0."""
    samples: SurfaceSamples
    """Samples of that surface, in the same frames."""
    surface_blocks: SurfaceBlocks
    """The samples in blocks for the search."""
    subsamples: SurfaceSubsamples
    """Subsamples of each sample's surface cell."""
    deviations: DeviationCells
    """How far the real surface is from the primitives, place by place."""
    sensors: SensorModel
    """Which sensor measures a contact on which link, and the noise."""
    prior: Prior
    """Prior distribution of contacts."""
    touchable: Annotated[Integers, "links"]
    """1 for links that are searched, else 0."""
    link_prior: Annotated[Floats, "links"]
    """Probability of a contact on each link before any measurement."""
    left_out: SurfaceMoments
    """Surfaces of the other links that can be touched; their prior probability is relative to that of a touch
    on any searched link."""
    unmodelled: SurfaceMoments
    """Places that the primitives do not model."""
    gravity: Annotated[Floats, "3"]
    """Gravity, base axes [m/s^2]."""
    link_sensors: LinkSensors
    """Place and load of the force/torque sensors within the arm."""
    torque_model: JointTorqueModel
    """Bias and friction in the joint torque signal."""
    inertia_error: float
    """Relative standard deviation of each link's mass."""
    bandwidth: float
    """Cut-off frequency of the observers [Hz]."""
    bias_rate: float
    """Inverse of the averaging time of biases [1/s]; 0: biases are constant."""
    limits: ReadingLimits
    """Limits of plausible readings."""
    thresholds: Annotated[Floats, f"4 * (link_sensors + 1), {STEPS}, 3"]
    """Onset and release thresholds, and the onset threshold of the residuals' EWMA, see
    `contactsense.detection.thresholds.stream_thresholds`."""


def sizes_of(constants: Constants) -> dict[str, int]:
    """The sizes that the declarations of `Constants` and of the state name."""
    return {
        "joints": constants.model.joints,
        "links": len(constants.touchable),
        "primitives": len(constants.surfaces.kind),
        "samples": len(constants.samples.spread),
        "blocks": len(constants.surface_blocks.length),
        "subsamples": len(constants.subsamples.spread),
        "link_sensors": len(constants.link_sensors.body),
        "deviations": len(constants.deviations.ratio),
    }


def build_constants(scene: Scene) -> Constants:
    """Constant arrays for the kernels.

    Raises:
        SceneError: no part of the surface can be touched, in any posture.
    """
    torque, base = scene.joint_torque or JointTorqueSensor(), scene.base_wrench or WrenchSensor()
    surfaces = scene_surfaces(scene)
    unsearched = unsearched_surfaces(scene)
    samples, subsamples, area = sample_surface(surfaces, float(unsearched.area.sum()))
    if not len(samples.point):
        raise SceneError(
            "bodies: expected a part of the touchable surface that is free, got none: bodies cover all of "
            f"{', '.join(scene.touchable_links)}, so that no place can be touched in any posture"
        )
    deviations = deviation_cells(scene, surfaces)
    samples = with_deviations(samples, surfaces, deviations)
    subsamples = with_deviations(subsamples, surfaces, deviations)
    share = area_share(surfaces, samples, len(scene.link_names))
    log_density = log_link_density(scene, share)
    return Constants(
        model=model_with_tool(scene),
        surfaces=surfaces,
        samples=samples,
        surface_blocks=surface_blocks(surfaces, samples),
        subsamples=subsamples,
        deviations=deviations,
        sensors=_sensors(scene),
        prior=Prior(
            friction_ratio=scene.friction / 2.0,
            torsion_lever=scene.torsion,
            surface_deviation=scene.surface_deviation,
            force=scene.force,
            clearance=scene.clearance,
            area=area,
            log_link_density=log_density,
        ),
        touchable=touchable_links(scene),
        link_prior=link_probability(scene, share),
        left_out=left_out_links(scene, unsearched, area),
        unmodelled=unmodelled_places(surfaces, samples, log_density),
        gravity=scene.gravity_base,
        link_sensors=link_sensors(scene),
        torque_model=joint_torque_model(torque, len(scene.robot.joints)),
        inertia_error=scene.inertia_error,
        bandwidth=scene.bandwidth,
        bias_rate=0.0 if scene.bias_time is None else 1.0 / scene.bias_time,
        limits=reading_limits(scene, wrench_transform(base.rotation, np.array(base.translation))),
        thresholds=stream_thresholds(scene),
    )


def _sensors(scene: Scene) -> SensorModel:
    joints = len(scene.robot.joints)
    links = len(scene.link_names)
    base = scene.base_wrench or WrenchSensor()
    transfer = wrench_transform(np.eye(3), np.array(base.translation))
    noise = np.array([base.force_noise] * 3 + [base.moment_noise] * 3)
    torque_noise = scene.joint_torque.noise if scene.joint_torque is not None else 1.0
    link_noise = [(s.force_noise, s.moment_noise) for s in scene.link_sensors.values()]
    return SensorModel(
        depth=np.minimum(np.arange(links), joints).astype(np.int64),
        first_link=np.array([mount.first_link for mount in mounts(scene).values()], dtype=np.int64),
        # The sensor's noise is isotropic, so its orientation does not matter here.
        base_covariance=transfer @ np.diag(noise**2) @ transfer.T,
        base_information=np.linalg.inv(transfer).T @ np.diag(noise**-2.0) @ np.linalg.inv(transfer),
        torque_variance=per_joint(torque_noise, joints) ** 2,
        link_variance=np.array(link_noise, dtype=np.float64).reshape(-1, 2) ** 2,
    )
