"""A straight walk over a triangle mesh: from facet to facet as if both were in one plane."""

from typing import NamedTuple

import numpy as np

from .surface import Place, Surface

_SHARP = np.cos(np.radians(45.0))
"""A finger slides over no edge at which the normal turns by more than this (cosine)."""
_FACETS = 20000
"""Facets that one walk crosses at most: among slivers it could turn around a vertex for ever."""


class Walk(NamedTuple):
    """M places along the walk, in the frame of the link; shape (M, 3) each."""

    points: np.ndarray
    """[m]"""
    normals: np.ndarray
    """Of the facets."""
    directions: np.ndarray
    """Unit vectors of the motion."""
    length: float
    """Way until the last place or until the mesh broke [m]."""


class Walker:
    """Walks over the visual meshes of an arm."""

    def __init__(self, surface: Surface) -> None:
        self._surface = surface
        self._neighbours: dict[int, np.ndarray] = {}

    def walk(self, start: Place, direction: np.ndarray, lengths: np.ndarray) -> Walk:
        """Walk from a place; where the mesh ends or bends sharply, the walk stops and stays.

        Args:
            start: Where to begin.
            direction: Unit tangent there, shape (3,), in the link's frame.
            lengths: Increasing distances from the start, shape (M,) [m].
        """
        link = start.link
        if link not in self._neighbours:
            self._neighbours[link] = neighbours(self._surface.faces[link])
        corners, normals = self._surface.corners[link], self._surface.normals[link]
        facet, entry, point, done = start.facet, -1, start.point, 0.0
        # One leg for each facet: (way before it, facet, point where it begins, direction).
        legs = [(0.0, facet, point, direction)]
        end = float(lengths[-1])
        while done < end and len(legs) < _FACETS:
            step, edge = _exit(corners[facet], normals[facet], point, direction, entry)
            if edge < 0 or done + step >= end:
                done = end if edge >= 0 else done
                break
            point, done = point + step * direction, done + step
            there = int(self._neighbours[link][facet, edge])
            if there < 0 or normals[there] @ normals[facet] < _SHARP:
                break
            back = int(np.flatnonzero(self._neighbours[link][there] == facet)[0])
            direction = _across(corners, normals, facet, edge, there, back, direction)
            facet, entry = there, back
            legs.append((done, facet, point, direction))
        way = np.minimum(lengths, done)
        leg = np.searchsorted([ahead for ahead, *_ in legs], way, side="right") - 1
        begun, facets, points, directions = (np.array(column) for column in zip(*legs, strict=True))
        return Walk(
            points[leg] + (way - begun[leg])[:, None] * directions[leg],
            normals[facets[leg]],
            directions[leg],
            done,
        )


def neighbours(faces: np.ndarray) -> np.ndarray:
    """The facet across each edge, -1 where there is none or more than one, shape (F, 3).

    Args:
        faces: Rows of three vertices, shape (F, 3); edge k connects corner k and the next.
    """
    ends = np.sort(np.stack((faces, np.roll(faces, -1, axis=1)), axis=-1).reshape(-1, 2), axis=1)
    _, edge, uses = np.unique(ends, axis=0, return_inverse=True, return_counts=True)
    edge = edge.reshape(-1)
    order = np.argsort(edge, kind="stable")
    order = order[uses[edge[order]] == 2]
    found = np.full(len(ends), -1)
    found[order[0::2]], found[order[1::2]] = order[1::2] // 3, order[0::2] // 3
    return found.reshape(-1, 3)


def _exit(
    corners: np.ndarray, normal: np.ndarray, point: np.ndarray, direction: np.ndarray, entry: int
) -> tuple[float, int]:
    """Distance to the edge by which the walk leaves a facet [m], and that edge; edge -1 if there is none."""
    inward = np.cross(normal, np.roll(corners, -1, axis=0) - corners)
    distance = np.einsum("ki,ki->k", inward, point - corners)
    rate = -inward @ direction
    steps = np.where(rate > 0.0, np.maximum(distance, 0.0) / np.where(rate > 0.0, rate, 1.0), np.inf)
    if entry >= 0:
        steps[entry] = np.inf
    edge = int(np.argmin(steps))
    return float(steps[edge]), edge if np.isfinite(steps[edge]) else -1


def _across(
    corners: np.ndarray,
    normals: np.ndarray,
    facet: int,
    edge: int,
    there: int,
    back: int,
    direction: np.ndarray,
) -> np.ndarray:
    """Direction in the next facet: turned with it about the edge between both."""
    along = corners[facet, (edge + 1) % 3] - corners[facet, edge]
    along /= np.linalg.norm(along)
    outward = np.cross(along, normals[facet])
    onward = np.cross(normals[there], corners[there, (back + 1) % 3] - corners[there, back])
    onward /= np.linalg.norm(onward)
    turned = (direction @ along) * along + (direction @ outward) * onward
    return np.asarray(turned / np.linalg.norm(turned))
