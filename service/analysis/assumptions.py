"""The assumptions of an analysis, in words."""

from contactsense.scene import Scene
from contactsense.service.scene.summary import surface_in_words, torque_errors_in_words


def assumptions(scene: Scene) -> list[str]:
    """The assumptions that the scene states, one sentence each."""
    mounting = scene.mounting if isinstance(scene.mounting, str) else f"rpy {scene.mounting} rad"
    found = [
        f"Robot {scene.robot.name}, mounting {mounting}, gravity {scene.gravity:g} m/s².",
        f"Tool: {scene.tool.name if scene.tool is not None else 'none'}.",
    ]
    base, torque = scene.base_wrench, scene.joint_torque
    if base is None:
        found.append(
            "No sensor under the base: places and forces are known only as far as the other sensors "
            "determine them."
        )
    else:
        found.append(
            f"Base sensor: white noise of {base.force_noise:g} N and {base.moment_noise:g} Nm per sample."
        )
    if torque is None:
        found.append("Joint torques are not used.")
    else:
        noise, *errors = torque_errors_in_words(torque)
        found.append(", ".join((f"Joint torques: signal {torque.signal}, white {noise}", *errors)) + ".")
    found += [
        f"{field}: white noise of {sensor.force_noise:g} N and {sensor.moment_noise:g} Nm per sample."
        for field, sensor in scene.link_sensors.items()
    ]
    most = "one contact" if scene.contacts == 1 else f"up to {scene.contacts} contacts"
    found += [
        f"Contacts push on the surface; friction coefficient {scene.friction:g}; forces of about "
        f"{scene.force:g} N are usual; torsion of about {1e3 * scene.torsion:g} mm times the normal force.",
        f"Surface: {surface_in_words(scene)}.",
        f"At most {most} at a time.",
        f"Forces are low-passed at {scene.bandwidth:g} Hz: shorter impacts appear smaller and longer.",
        f"False alarms from noise alone: {scene.false_alarms_per_hour:g} per hour.",
    ]
    if scene.touchable_links != scene.link_names:
        found.append(f"Only these links can be touched: {', '.join(scene.touchable_links)}.")
    found.append(_link_prior(scene))
    return found


def _link_prior(scene: Scene) -> str:
    """How probable a contact on each link is before any measurement."""
    if scene.link_prior == "area":
        return "Before any measurement, contacts are equally probable everywhere on the surface."
    if scene.link_prior == "equal":
        return "Before any measurement, all links are equally probable."
    weights = ", ".join(f"{name} {weight:g}" for name, weight in scene.link_prior.items())
    return f"Before any measurement, links are probable in proportion to these weights: {weights}."
