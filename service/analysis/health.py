"""Assessment of model and sensors from a recording."""

import numpy as np

from contactsense.sensors.timing import LONGEST_FIRST_STEP
from contactsense.service.analysis.analysis import Analysis
from contactsense.service.analysis.present_sensors import in_scene
from contactsense.service.recordings.signals.column_mapping import SHORTEST_STEP, unit_hint
from contactsense.service.recordings.time_extent import UNORDERED_ADVICE

TOO_LARGE = 1.3
"""Residuals larger than this many standard deviations indicate a wrong model or wrong noise."""
LONG_STEP = 0.025
"""With samples further apart, the observers do not follow fast motion: of a simulated UR5e that moved 0.6 rad
within 1 s, contacts were reported at 20 Hz, none at 50 Hz [s]."""
UNJUDGED = "no sample could be used: whether anything touched the arm is not known"
"""What is reported of a recording without a usable sample."""
MISLEADING = 3.0
"""Residuals larger than this many standard deviations make contacts of what is none. The thresholds of the
onset are at most six standard deviations of the stated noise; where residuals are three times as large, that
is at most two of their own, which free motion reaches again and again."""
CONTRADICTION = 0.05
"""Sensors that contradict each other, or have more noise than stated, in a larger share of the samples show a
wrong scene. In the recordings of docs/analysis.md, and in those of simulated arms with the right scene, also
where two contacts act at a time, they do not in any sample."""
UNEXPLAINED = 0.2
"""Larger share of the time during which no single contact explains the readings. Among simulated pairs of
contacts it reaches that, with the right scene it does not otherwise."""
_COMPONENTS = ("Fx", "Fy", "Fz", "Mx", "My", "Mz")


def warning(analysis: Analysis) -> str:
    """Why the contacts as a whole are not to be relied on, and what to do; empty if they are."""
    if not analysis.is_ordered:
        return ""  # the residuals say nothing about the scene
    found, reasons = analysis.residuals, []
    if analysis.doubt:
        reasons.append("the readings have not fitted a free arm since the recording began")
    worst = max((float(ratio.max()) for _, _, ratio in _ratios(analysis)), default=0.0)
    if worst > MISLEADING:
        reasons.append(f"residuals without contact are up to {worst:.1f} times their standard deviation")
    # At low rates the reason is how the arm moves between two samples, see `health`.
    if found.inconsistent > CONTRADICTION * analysis.samples and analysis.step <= LONG_STEP:
        share = _share(found.inconsistent, analysis.samples)
        reasons.append(
            f"in {share} of the samples sensors contradicted each other or had more noise than stated"
        )
    unused = [
        name
        for i, (name, there) in enumerate(in_scene(analysis.scene).items())
        if there and found.missing[i] == analysis.samples
    ]
    if unused and analysis.judged:
        reasons.append(f"{' and '.join(unused)} could not be used in any sample")
    if not reasons:
        return ""
    return (
        f"The scene does not fit this recording: {', and '.join(reasons)}. What is listed as contact may be "
        "none. Run `contactsense calibrate` on contact-free motion of this arm, or find the wrong line with "
        "`contactsense check`, and analyse again."
    )


def health(analysis: Analysis) -> list[tuple[bool, str]]:
    """Findings as (whether all is well, sentence)."""
    found, scene = analysis.residuals, analysis.scene
    findings = [(False, problem) for problem in analysis.problems]
    count = max(analysis.samples, 1)
    for i, (name, there) in enumerate(in_scene(scene).items()):
        if there and found.missing[i]:
            findings.append(
                (False, f"{name} was missing in {_share(found.missing[i], count)} of the samples.")
            )
    if found.degraded:
        findings.append(
            (
                found.degraded < 0.05 * count,
                f"Estimates were degraded in {_share(found.degraded, count)} of the samples: a sensor was "
                "missing, invalid or inconsistent, or the observers settled.",
            )
        )
    if unexplained := _unexplained(analysis):
        findings.append((False, unexplained))
    if not analysis.is_ordered:
        findings.append(
            (
                False,
                "timestamp: expected rows in the order of time, got many that are earlier than the row "
                f"before. {UNORDERED_ADVICE}.",
            )
        )
        return findings
    step = analysis.step
    if not analysis.judged and (unusable := unusable_steps(step)):
        findings.append((False, unusable))
    if not analysis.judged and any("are they in degrees?" in problem for problem in analysis.problems):
        findings.append((False, "Positions in degrees are read with --columns angle_unit=deg."))
    if analysis.judged and step > LONG_STEP:
        findings.append(
            (
                False,
                f"Samples are {step:.2g} s apart: how the arm moves between them is not known, and fast "
                "motion may look like contacts. Record at 50 Hz or more.",
            )
        )
    if found.free == 0:
        # All samples may still be estimated, from the other sensors.
        which = "free of contact" if found.touched == analysis.samples else "free of contact and not degraded"
        findings.append((False, f"No sample is {which}: model and noise cannot be checked."))
        return findings
    for name, parts, ratio in _ratios(analysis):
        text = ", ".join(f"{part} {x:.2f}" for part, x in zip(parts, ratio, strict=True))
        well = bool(np.all(ratio <= TOO_LARGE))
        advice = "" if well else " Calibrate on contact-free motion, or state more noise."
        findings.append((well, f"{name}: residuals without contact in standard deviations: {text}.{advice}"))
    return findings


def _unexplained(analysis: Analysis) -> str:
    """What is said where no single contact explains the readings for a long time; empty if that is not so."""
    contacts = [contact.duration for contact in analysis.contacts if not contact.link]
    if sum(contacts) <= UNEXPLAINED * (analysis.duration - analysis.gap_seconds):
        return ""
    return (
        f"For {sum(contacts):.1f} s the readings are neither those of a free arm nor those of one contact: "
        "several contacts at a time, or a payload that the scene does not have?"
    )


def unusable_steps(step: float) -> str:
    """What is wrong with the usual time between two samples of which none could be used, and the likely
    reason; empty if it is not the time.

    Args:
        step: That time as read [s].
    """
    if step > LONGEST_FIRST_STEP:
        return (
            f"timestamp: expected samples at most {LONGEST_FIRST_STEP:g} s apart, got {step:.3g} s on "
            f"average{unit_hint(step, LONGEST_FIRST_STEP)}"
        )
    if 0.0 < step < SHORTEST_STEP:
        return (
            f"timestamp: expected samples at least {SHORTEST_STEP:g} s apart, got {step:.3g} s on average; "
            "are they in another unit than --columns says (time_unit)?"
        )
    return ""


def _ratios(analysis: Analysis) -> list[tuple[str, tuple[str, ...], np.ndarray]]:
    """Sensor, components, and their residuals without contact in standard deviations; none if there is no
    sample without contact."""
    found, scene = analysis.residuals, analysis.scene
    groups: list[tuple[str, tuple[str, ...], np.ndarray]] = []
    if found.free and scene.base_wrench is not None:
        groups.append(("base_wrench", _COMPONENTS, found.base_ratio))
    if found.free and scene.joint_torque is not None:
        groups.append(("joint_torque", tuple(joint.name for joint in scene.robot.joints), found.joint_ratio))
    return groups


def _share(part: int, whole: int) -> str:
    percent = 100.0 * part / whole
    return f"{percent:.0f} %" if percent >= 10.0 else f"{percent:.2g} %"
