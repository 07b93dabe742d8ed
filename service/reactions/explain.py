"""Describes rules in words."""

import math

from contactsense.scene import Scene
from contactsense.service.reactions.rules import ANY, ExpectedContact, Level, ReactionRules, Rule

_DEGRADED = {
    "act": "A degraded estimate counts like any other.",
    "hold": "During degraded estimates nothing begins and nothing ends.",
    "ignore": "Degraded estimates count as no contact.",
}


def explain(rules: ReactionRules, rule: Rule, scene: Scene) -> str:
    """Describe one rule; its actions are named, see `explain_actions`.

    Raises:
        RulesError: A link is unknown.
    """
    parts = [f"{rule.name}: on {_links(rules, rule.links, scene)}{_when(rules, rule)}{_where(rule)}:"]
    if rule.contact is not None:
        parts.append(f"contact {_level(rule.contact)}, until the force has gone.")
    if rule.collision is not None:
        parts.append(f"collision {_level(rule.collision)}, latched until it is acknowledged.")
    return " ".join([*parts, _DEGRADED[rule.on_degraded]])


def explain_expected(rules: ReactionRules, expected: ExpectedContact, scene: Scene) -> str:
    """Describe one expected contact.

    Raises:
        RulesError: A link is unknown.
    """
    place = "" if expected.point is None else f" within {expected.radius:g} m of {expected.point}"
    links = _links(rules, expected.links, scene)
    return (
        f"{expected.name}: when announced, contacts on {links}{place} may reach {expected.force:g} N, "
        f"for at most {expected.timeout:g} s."
    )


def explain_actions(rules: ReactionRules) -> dict[str, str]:
    """Describe each action once, by name; those that no rule uses as well."""
    return {name: action.describe() for name, action in rules.actions.items()}


def _links(rules: ReactionRules, names: tuple[str, ...], scene: Scene) -> str:
    """The links for which names in a rule stand, those of groups as well."""
    if ANY in names:
        return "any link"
    found = rules.links_of(names, scene)
    return ", ".join(link for link in scene.link_names if link in found)


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
