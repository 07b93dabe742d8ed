"""Describes rules in words."""

import math

from contactsense.service.reactions.rules import ANY, Level, ReactionRules, Rule

_DEGRADED = {
    "act": "A degraded estimate counts like any other.",
    "hold": "During degraded estimates nothing begins and nothing ends.",
    "ignore": "Degraded estimates count as no contact.",
}


def explain(rules: ReactionRules, rule: Rule) -> str:
    """Describe one rule; its actions are named, see `explain_actions`."""
    links = "any link" if ANY in rule.links else ", ".join(rule.links)
    parts = [f"{rule.name}: on {links}{_when(rules, rule)}{_where(rule)}:"]
    if rule.contact is not None:
        parts.append(f"contact {_level(rule.contact)}, until the force has gone.")
    if rule.collision is not None:
        parts.append(f"collision {_level(rule.collision)}, latched until it is acknowledged.")
    return " ".join([*parts, _DEGRADED[rule.on_degraded]])


def explain_actions(rules: ReactionRules) -> dict[str, str]:
    """Describe each action once, by name; those that no rule uses as well."""
    return {name: action.describe() for name, action in rules.actions.items()}


def _when(rules: ReactionRules, rule: Rule) -> str:
    speed = f"{rules.moving_speed:g} rad/s"
    return {
        "any": "",
        "moving": f" while a joint is faster than {speed}",
        "rest": f" while no joint is faster than {speed}",
    }[rule.condition]


def _where(rule: Rule) -> str:
    direction = rule.direction
    if direction is None:
        return ""
    axis = ", ".join(f"{value:g}" for value in direction.axis)
    return (
        f" for forces within {math.degrees(direction.half_angle):.0f} degrees of ({axis}) in "
        f"{direction.frame} axes"
    )


def _level(level: Level) -> str:
    held = f" for {1e3 * level.duration:g} ms" if level.duration > 0.0 else ""
    return (
        f"above {level.force:g} N with probability {level.probability:g}{held}: "
        f"{', '.join(level.actions) or 'no action'}"
    )
