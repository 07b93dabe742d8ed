"""Tables of `contactsense map`, 80 columns wide."""

from collections.abc import Iterable, Sequence
from math import isfinite

import click
from rich import box
from rich.console import Console
from rich.table import Table

from contactsense.residuals.joint_friction import joint_torque_model, unmodelled_torque_std
from contactsense.scene import Scene
from contactsense.sensors.settings import per_joint
from contactsense.surface_map.detectability import Detectability, LinkDetectability

WIDTH = 80
HEADINGS = ("force [N]", "error [mm]", "named")
LARGEST_FORCE = 1000.0
"""Forces above this are shown as not detected [N]."""


def show_map(scene: Scene, found: Detectability) -> None:
    """One map by link: median over the link's surface, and the value that 95 % of it does not exceed."""
    click.echo(f"{scene.robot.name}: {_sensors(scene)}")
    table = Table(box=box.SIMPLE_HEAD)
    table.add_column("link")
    table.add_column("surface", justify="right")
    for heading in HEADINGS:
        table.add_column(heading, justify="right")
        table.add_column("worst", justify="right")
    for link in found.by_link():
        table.add_row(
            link.link,
            f"{100 * link.share:.0f} %",
            *(_force(value) for value in link.smallest_force),
            *_errors(link),
            *_named(link),
        )
    Console(width=WIDTH, markup=False).print(table)
    click.echo("Median over the surface of the link; worst: 5 % of it is worse than this.")
    _explain([found])


def compare_maps(titles: Sequence[str], scenes: Sequence[Scene], found: Sequence[Detectability]) -> None:
    """Two maps of one arm side by side: medians over the surface of each link."""
    for letter, title, scene in zip("AB", titles, scenes, strict=True):
        click.echo(f"{letter}: {title}: {scene.robot.name}: {_sensors(scene)}")
    table = Table(box=box.SIMPLE_HEAD)
    table.add_column("link")
    for heading in HEADINGS:
        table.add_column(f"{heading} A", justify="right")
        table.add_column("B", justify="right")
    maps = [{link.link: link for link in one.by_link()} for one in found]
    for name in dict.fromkeys(name for one in maps for name in one):
        links = [one.get(name) for one in maps]
        cells = [link and _force(link.smallest_force[0]) for link in links]
        cells += [link and _errors(link)[0] for link in links]
        cells += [link and _named(link)[0] for link in links]
        table.add_row(name, *cells)
    Console(width=WIDTH, markup=False).print(table)
    click.echo("Medians over the surface of each link.")
    _explain(found)


def _explain(maps: Sequence[Detectability]) -> None:
    """What the columns mean; false alarms are those of each scene, all else is the same for both."""
    found, rates = maps[0], list(dict.fromkeys(each.false_alarms_per_hour for each in maps))
    alarms = f"{rates[0]:g}" if len(rates) == 1 else f"{rates[0]:g} (A) and {rates[1]:g} (B)"
    click.echo(
        f"force: smallest that is detected, with probability {found.detection:g}, in one measurement\n"
        f"  of the arm at rest, at {alarms} false alarms per hour\n"
        f"error: of the place, for {found.force:g} N along the inward normal; median of the answers\n"
        "named: probability of naming the link for that push\n"
        "error and named also count pushes too weak to be detected: compare with force\n"
        f"-: undetermined: no force up to {LARGEST_FORCE:g} N is detected; or fewer\n"
        "  than one in five answers is on the link"
    )


def _sensors(scene: Scene) -> str:
    """The sensors and their noise."""
    parts = []
    others = ((sensor.name, sensor) for sensor in scene.link_wrenches)
    for name, sensor in (("base", scene.base_wrench), *others, ("wrist", scene.wrist_wrench)):
        if sensor is not None:
            parts.append(f"{name} {sensor.force_noise:g} N, {sensor.moment_noise:g} Nm")
    if scene.joint_torque is not None:
        joints = len(scene.robot.joints)
        model = joint_torque_model(scene.joint_torque, joints)
        errors = [unmodelled_torque_std(model, j, 0.0) for j in range(joints)]
        stated = f" with model errors of {_range(errors)}" if any(errors) else ""
        parts.append(f"joint torques {_range(per_joint(scene.joint_torque.noise, joints))}{stated}")
    return "; ".join(parts)


def _range(torques: Iterable[float]) -> str:
    levels = sorted(torques)
    return " to ".join(f"{x:.3g}" for x in dict.fromkeys((levels[0], levels[-1]))) + " Nm"


def _force(value: float) -> str:
    return f"{value:.3g}" if value <= LARGEST_FORCE else "-"


def _errors(link: LinkDetectability) -> tuple[str, ...]:
    """Errors in millimetres, unless pushes on most of the link are not detected at all."""
    detected = _is_detected(link)
    return tuple(f"{1e3 * value:.1f}" if detected and isfinite(value) else "-" for value in link.error)


def _named(link: LinkDetectability) -> tuple[str, ...]:
    """Probabilities of naming the link, unless pushes on most of it are not detected at all."""
    detected = _is_detected(link)
    return tuple(f"{value:.2f}" if detected else "-" for value in link.link_probability)


def _is_detected(link: LinkDetectability) -> bool:
    return link.smallest_force[0] <= LARGEST_FORCE
