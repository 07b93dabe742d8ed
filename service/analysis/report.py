"""The report on a recording: one HTML file that needs no internet connection, and the same as Markdown."""

import json
import re
from html import escape
from pathlib import Path
from typing import Any

import jinja2
import numpy as np
from markupsafe import Markup

from contactsense.detection.thresholds import sensor_set, stream_thresholds, threshold_index
from contactsense.robots.files.whole_file import write_text
from contactsense.scene import Scene
from contactsense.service.analysis.analysis import Analysis
from contactsense.service.analysis.assumptions import assumptions
from contactsense.service.analysis.health import UNJUDGED, health, warning
from contactsense.service.analysis.summary.contact_summary import ContactSummary, millimetres
from contactsense.service.analysis.summary.force_limits import DISCLAIMER
from contactsense.service.analysis.summary.other_links import other_links
from contactsense.service.analysis.summary.summarize import Summarizer
from contactsense.service.analysis.summary.undetermined_forces import doubted_forces
from contactsense.service.drawing.arm_scene import arm_geometry, arm_view, contact_view, view_script
from contactsense.service.drawing.contact_shapes import ARROW_MEANING
from contactsense.service.drawing.palette import CONTACT, NOWHERE, link_colour
from contactsense.service.drawing.timeline_svg import Curve, panel
from contactsense.service.percent import in_percent

DETAILED = 40
"""Number of contacts shown individually: those with the largest force. The table lists all."""

_templates = jinja2.Environment(
    loader=jinja2.FileSystemLoader(Path(__file__).parent / "templates"),
    autoescape=jinja2.select_autoescape(["html.j2"]),
    trim_blocks=True,
    lstrip_blocks=True,
    undefined=jinja2.StrictUndefined,
)
_templates.globals |= {"nowhere": NOWHERE, "contact": CONTACT}


def _code(text: str) -> Markup:
    """HTML of a message, in which commands and fields stand between backticks."""
    return Markup(re.sub("`([^`]+)`", r"<code>\1</code>", escape(text)))


_templates.filters["code"] = _code


def write_report(analysis: Analysis, folder: Path) -> None:
    """Write `report.html` and `report.md` into a folder, each whole or not at all.

    Raises:
        OSError: a file cannot be written.
    """
    content = _content(analysis)
    write_text(folder / "report.html", render("report.html.j2", content))
    write_text(folder / "report.md", render("report.md.j2", content))


def render(template: str, content: dict[str, Any]) -> str:
    """Fill in one of the templates in this folder."""
    return _templates.get_template(template).render(content)


def _content(analysis: Analysis) -> dict[str, Any]:
    """The content of the templates."""
    scene = analysis.scene
    strongest = sorted(analysis.contacts, key=lambda contact: -contact.peak_force)[:DETAILED]
    chosen = {contact.contact for contact in strongest}
    links = sorted({(c.link_index, c.link or "no single place") for c in analysis.contacts})
    return {
        "analysis": analysis,
        "name": Path(analysis.recording).name,
        "robot": scene.robot.name,
        "legend": [(link_colour(index), name) for index, name in links],
        "timeline": _timeline(analysis),
        "residuals": _residual_panels(analysis),
        "contacts": [_contact(contact, analysis) for contact in analysis.contacts],
        "detailed": [_contact(c, analysis) for c in analysis.contacts if c.contact in chosen],
        "chosen": chosen,
        "hidden": len(analysis.contacts) - len(chosen),
        "warning": warning(analysis),
        "unjudged": UNJUDGED,
        "health": health(analysis),
        "assumptions": assumptions(scene),
        "disclaimer": DISCLAIMER,
        "undetermined": doubted_forces(scene, analysis.contacts),
        "arrow": ARROW_MEANING,
        "script": view_script(),
        "data": json.dumps(_views(analysis, chosen), separators=(",", ":")).replace("</", "<\\/"),
    }


def _contact(contact: ContactSummary, analysis: Analysis) -> dict[str, Any]:
    """One contact, with its numbers as text."""
    texts = other_links(analysis.scene.link_names, contact.link_index, contact.link_probability.tolist())
    none = 1.0 - float(np.sum(contact.link_probability))
    explained = contact.link_index >= 0
    # Live probabilities are means over the contact; that of the place is not.
    if contact.smoothed:
        elsewhere = float(contact.link_probability[contact.link_index]) - contact.probability
        if elsewhere >= 0.01:
            texts.insert(0, f"another place on {contact.link} ({in_percent(elsewhere)})")
    tangential = _place_deviation(contact) if explained else None
    if none >= 0.01:
        texts.append(f"no single push on a touchable link ({in_percent(none)})")
    return {
        "number": contact.contact,
        "begin": f"{contact.begin:.3f}",
        "duration": f"{contact.duration:.2f}",
        "link": contact.link or "no single place",
        "colour": link_colour(contact.link_index),
        "probability": in_percent(contact.probability),
        "point": millimetres(contact.point) if explained else "",
        "point_base": millimetres(contact.point_base) if explained else "",
        "deviation": "" if tangential is None else f"{1e3 * tangential:.1f}",
        "peak_force": f"{contact.peak_force:.1f}",
        "quasi_static_force": f"{contact.quasi_static_force:.1f}",
        "transient_force": f"{contact.transient_force:.1f}",
        "impulse": f"{contact.impulse:.2f}",
        "torsion": f"{contact.torsion:z.3f}" if explained else "",
        "speed": f"{contact.speed:.2f}" if explained else "",
        "slides": contact.slides,
        "complete": contact.complete,
        "explained": explained,
        "smoothed": contact.smoothed,
        "others": texts,
        "row": contact.row,
        "exceeded": [] if analysis.limits is None else analysis.limits.exceeded(contact),
        "curve": panel(
            [Curve(contact.curve.t, contact.curve.force, link_colour(contact.link_index), filled=True)],
            (contact.begin, contact.begin + contact.duration),
            "force / N",
            f"force of contact {contact.contact}",
            160,
        ),
    }


def _place_deviation(contact: ContactSummary) -> float:
    """Largest standard deviation of the place along the surface [m]."""
    n = contact.normal_base
    P = np.eye(3) - np.outer(n, n)
    return float(np.sqrt(max(np.linalg.eigvalsh(P @ contact.covariance @ P)[-1], 0.0)))


def _timeline(analysis: Analysis) -> str:
    span = (analysis.start, analysis.start + analysis.duration)
    curves = [
        Curve(
            contact.curve.t,
            contact.curve.force,
            link_colour(contact.link_index),
            f"contact {contact.contact}: {contact.link or 'no single place'}, {contact.peak_force:.1f} N",
            filled=True,
        )
        for contact in analysis.contacts
    ]
    return panel(curves, span, "force / N", "forces of the contacts over time", 240)


def _residual_panels(analysis: Analysis) -> list[tuple[str, str]]:
    """Residuals compared with their noise: heading and picture."""
    found, scene = analysis.residuals, analysis.scene
    span = (analysis.start, analysis.start + analysis.duration)
    threshold = _threshold(scene, analysis)
    begins = "where a contact begins"
    if scene.base_wrench is None:
        begins += " at once (a weaker one begins when it has lasted)"
    panels = [
        (
            f'Energy of "nothing touches" (logarithm to base 10), dashed: {begins}',
            panel(
                [
                    Curve(found.t, np.log10(1.0 + found.energy), NOWHERE, 'energy of "nothing touches"'),
                    Curve(np.array(span), np.full(2, np.log10(1.0 + threshold)), CONTACT, dashed=True),
                ],
                span,
                "log10(1 + energy)",
                'energy of "nothing touches"',
            ),
        )
    ]
    if scene.base_wrench is not None:
        panels.append(
            (
                "External force on the base sensor, dashed: three standard deviations without contact",
                panel(
                    [
                        Curve(found.t, found.base_force, link_colour(1), "external force on the base sensor"),
                        Curve(found.t, 3.0 * found.base_force_std, CONTACT, dashed=True),
                    ],
                    span,
                    "force / N",
                    "external force on the base sensor",
                ),
            )
        )
    if scene.joint_torque is not None:
        for j, joint in enumerate(scene.robot.joints):
            panels.append(
                (
                    f"External torque about {escape(joint.name)}, dashed: three standard deviations",
                    panel(
                        [
                            Curve(found.t, found.joint_torque[:, j], link_colour(j + 1)),
                            Curve(found.t, 3.0 * found.joint_torque_std[:, j], CONTACT, dashed=True),
                        ],
                        span,
                        "torque / Nm",
                        f"external torque about {joint.name}",
                        130,
                    ),
                )
            )
    return panels


def _threshold(scene: Scene, analysis: Analysis) -> float:
    """Energy at which a contact begins when all sensors of the scene have a value."""
    links = (1 << len(scene.link_sensors)) - 1
    chosen = sensor_set(scene.base_wrench is not None, scene.joint_torque is not None, links)
    return float(stream_thresholds(scene)[chosen, threshold_index(analysis.step), 0])


def _views(analysis: Analysis, chosen: set[int]) -> dict[str, Any]:
    """The 3D drawings as data."""
    scene = analysis.scene
    summarizer = Summarizer(scene)
    up = -scene.gravity_base / np.linalg.norm(scene.gravity_base)
    views = {}
    for contact in analysis.contacts:
        if contact.contact in chosen:
            poses = [summarizer.link_pose(contact.q, link) for link in range(len(scene.link_names))]
            views[contact.contact] = arm_view(poses, up) | contact_view(
                scene,
                poses,
                contact.link_index,
                contact.point_base,
                contact.normal_base,
                contact.covariance,
                contact.force_base,
            )
    return {"geometry": arm_geometry(scene) if views else [], "views": views}
