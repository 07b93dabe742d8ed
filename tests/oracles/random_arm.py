"""Arms without any symmetry that could hide a mistake."""

import numpy as np

from contactsense.robots import Inertia, Joint, Link, Robot


def random_rotation(chance: np.random.Generator) -> np.ndarray:
    q, r = np.linalg.qr(chance.standard_normal((3, 3)))
    q = q * np.sign(np.diag(r))
    return q if np.linalg.det(q) > 0 else -q


def random_arm(seed: int, joints: int) -> Robot:
    """Tilted axes, full inertia tensors, rotors, a base whose mass is off its origin."""
    chance = np.random.default_rng(seed)

    def inertia() -> Inertia:
        root = chance.standard_normal((3, 3)) * 0.1
        tensor = root @ root.T
        tensor = tensor + 0.5 * np.trace(tensor) * np.eye(3)  # triangle inequality holds
        return Inertia(chance.uniform(0.5, 8.0), chance.uniform(-0.2, 0.2, 3), tensor)

    def axis() -> np.ndarray:
        vector = chance.standard_normal(3)
        return vector / np.linalg.norm(vector)

    return Robot(
        name="random",
        links=tuple(Link(f"link_{i}", inertia()) for i in range(joints + 1)),
        joints=tuple(
            Joint(
                name=f"joint_{i}",
                rotation=random_rotation(chance),
                translation=chance.uniform(-0.5, 0.5, 3),
                axis=axis(),
                position_limits=(-6.0, 6.0),
                velocity_limit=3.0,
                torque_limit=100.0,
                rotor_inertia=chance.uniform(0.0, 1.0),
            )
            for i in range(joints)
        ),
    )
