"""How far a skin is from its primitives, place by place, on a plate whose error is known."""

import numpy as np
import pytest
from scipy.cluster.vq import kmeans2

from contactsense.robots.decomposition import local_deviation as measured
from contactsense.robots.decomposition.local_deviation import CELL, local_deviation
from contactsense.robots.decomposition.outer_skin import Skin
from contactsense.robots.decomposition.surface_error import bodies_of
from contactsense.robots.primitives import Box
from contactsense.robots.robot import LocalDeviation
from contactsense.robots.surface.deviation_table import lines, read_cells

HALF = 0.2
STEP = 0.003
"""The right half of the real plate is this much higher or lower than the primitive [m] ..."""
TILT = 0.3
"""... and its normals are tilted by this angle [rad]."""


def plate() -> Skin:
    """The upper face of a plate, true on the left, rough on the right."""
    rng = np.random.default_rng(1)
    points = np.column_stack((rng.uniform(-HALF, HALF, (8000, 2)), np.zeros(8000)))
    normals = np.tile([0.0, 0.0, 1.0], (8000, 1))
    rough = points[:, 0] > 0.0
    points[rough, 2] += STEP * rng.choice([-1.0, 1.0], rough.sum())
    normals[rough] = [np.sin(TILT), 0.0, np.cos(TILT)]
    return Skin(points, normals, np.ones(8000), (2 * HALF) ** 2)


Cells = tuple[LocalDeviation, ...]
BOX = Box(center=(0.0, 0.0, -0.05), rpy=(0.0, 0.0, 0.0), half=(0.25, 0.25, 0.05), rounding=0.01)


def test_each_cell_has_the_deviations_of_its_part_of_the_skin() -> None:
    cells = local_deviation(bodies_of([BOX]), plate())
    assert len(cells) == round((2 * HALF / CELL) ** 2)
    x = np.array([cell.point[0] for cell in cells])
    offset, tilt = (np.array([getattr(cell, name) for cell in cells]) for name in ("offset", "tilt"))
    rough, true = x > CELL, x < -CELL
    np.testing.assert_allclose(offset[rough], STEP, rtol=0.05)
    # An angle is that of two tangents.
    np.testing.assert_allclose(tilt[rough], TILT / np.sqrt(2.0), rtol=0.05)
    assert offset[true].max() < STEP / 3.0
    np.testing.assert_allclose([cell.point[2] for cell in cells], 0.0, atol=1e-9)


def test_cells_begin_where_those_of_k_means_plus_plus_do() -> None:
    points = plate().points
    mine = measured._seeds(points, 100, np.random.default_rng(3))
    center, cell = kmeans2(points, 100, minit="++", rng=np.random.default_rng(3))
    own_center, own_cell = kmeans2(points, mine, minit="matrix")
    np.testing.assert_array_equal(own_center, center)
    np.testing.assert_array_equal(own_cell, cell)


def test_cells_of_a_large_body_have_samples() -> None:
    """A fence of 16 m^2 with 8000 samples would have 10000 cells."""
    skin = plate()
    fence = skin._replace(points=10.0 * skin.points, area=100.0 * skin.area)
    large = Box(center=(0.0, 0.0, -0.05), half=(2.5, 2.5, 0.05), rounding=0.01)
    cells = local_deviation(bodies_of([large]), fence)
    assert len(cells) == 8000 // measured.CELL_SAMPLES
    assert np.isfinite([cell.offset for cell in cells]).all()


def test_a_cell_with_both_faces_of_a_thin_plate_is_not_moved() -> None:
    x, y, z = np.meshgrid((-0.004, 0.0, 0.004), (-0.004, 0.0, 0.004), (-0.0015, 0.0015))
    points = np.column_stack((x.ravel(), y.ravel(), z.ravel()))
    normals = np.column_stack((np.zeros((18, 2)), np.sign(points[:, 2])))
    skin = Skin(points, normals, np.ones(18), 2.0 * 0.01**2)
    thin = Box(center=(0.0, 0.0, 0.0), half=(0.005, 0.005, 0.001), rounding=0.0005)
    (cell,) = local_deviation(bodies_of([thin]), skin, moved=True)
    assert (cell.shift, cell.turn) == ((0.0,) * 3, (0.0,) * 3)
    assert cell.offset == pytest.approx(0.0005)


def test_samples_that_can_seldom_be_touched_count_little() -> None:
    skin = plate()
    rough = skin.points[:, 0] > 0.0
    hidden = skin._replace(exposure=np.where(rough, 0.0, 1.0))
    assert max(cell.offset for cell in local_deviation(bodies_of([BOX]), hidden)) < 1e-4


def test_lines_of_a_surface_file_are_read_as_they_were_written() -> None:
    cells = local_deviation(bodies_of([BOX]), plate())
    again = read_cells("\n".join(lines(cells)), 1)
    for name, tolerance in (("point", 6e-4), ("offset", 6e-6), ("tilt", 0.01)):
        written, read = ([getattr(cell, name) for cell in some] for some in (cells, again))
        np.testing.assert_allclose(read, written, atol=tolerance)


def hill() -> Skin:
    """A plate whose upper face is a ridge: it rises by `TILT` on the left, and falls on the right."""
    rng = np.random.default_rng(2)
    points = np.column_stack((rng.uniform(-HALF, HALF, (40000, 2)), np.zeros(40000)))
    side = np.sign(points[:, 0])
    points[:, 2] = 0.02 - np.tan(TILT) * (np.abs(points[:, 0]) - HALF / 2.0)
    normals = np.column_stack((side * np.sin(TILT), np.zeros(40000), np.full(40000, np.cos(TILT))))
    return Skin(points, normals, np.ones(40000), (2 * HALF) ** 2)


@pytest.fixture(scope="module")
def moved() -> Cells:
    """The hill's cells, with the motions that take the primitive onto its skin."""
    return local_deviation(bodies_of([BOX]), hill(), moved=True)


@pytest.mark.slow
def test_the_moved_surface_is_the_skins_where_that_is_plane(moved: Cells) -> None:
    """On each side the primitive is moved onto the skin, and nothing remains; the ridge and the rims, where
    the nearest point of the primitive is on its rounding, are left out."""
    plain = [cell for cell in moved if CELL < abs(cell.point[0]) < HALF - CELL and abs(cell.point[1]) < HALF]
    assert len(plain) > 30
    for cell in plain:
        side, x = np.sign(cell.point[0]), abs(cell.point[0])
        height = 0.02 - np.tan(TILT) * (x - HALF / 2.0)
        # About 200 samples, three more of the prior: they lower the height by 1.5 to 2 %, and the rest of it
        # remains. The slope's prior counts as much; to the deviations it adds a share of the ridge's.
        np.testing.assert_allclose(cell.shift, (0.0, 0.0, height), atol=0.02 * abs(height) + 2e-4)
        np.testing.assert_allclose(cell.turn, (0.0, side * TILT, 0.0), atol=0.1 * TILT)
        assert cell.offset < 0.02 * abs(height) + 4e-4
        assert cell.tilt < 0.1 * TILT
    # Unmoved, all of that is error.
    still = local_deviation(bodies_of([BOX]), hill())
    assert {(cell.shift, cell.turn) for cell in still} == {((0.0,) * 3, (0.0,) * 3)}
    assert np.median([cell.offset for cell in still]) > 0.01


@pytest.mark.slow
def test_what_remains_is_never_more_than_what_was(monkeypatch: pytest.MonkeyPatch) -> None:
    # In the same cells.
    monkeypatch.setattr(measured, "MOVED_CELL", CELL)
    for skin in (plate(), hill()):
        moved, still = (local_deviation(bodies_of([BOX]), skin, moved=moved) for moved in (True, False))
        np.testing.assert_allclose([c.point for c in moved], [c.point for c in still])
        assert all(m.offset <= s.offset * 1.001 for m, s in zip(moved, still, strict=True))


@pytest.mark.slow
def test_motions_are_read_as_they_were_written(moved: Cells) -> None:
    again = read_cells("\n".join(lines(moved)), 1)
    for name, tolerance in (("point", 6e-4), ("shift", 6e-6), ("turn", 0.01)):
        written, read = ([getattr(cell, name) for cell in some] for some in (moved, again))
        np.testing.assert_allclose(read, written, atol=tolerance)


@pytest.mark.parametrize(
    "line",
    [
        "1 0 0 0 0.5 3",
        "0.5 0 0 0 0.5 3",
        "0 0 0 0 0.5",
        "0 0 0 0 0 3",
        "0 0 0 0 0.5 95",
        "0 a 0 0 1 1",
        "0 nan 0 0 1 1",
        "0 0 0 0 0.5 3 1 1 1",
        "0 0 0 0 0.5 3 inf 0 0 0 0 0",
        "0 0 0 0 0.5 3 0 600 0 0 0 0",
        "0 0 0 0 0.5 3 0 0 0 80 80 0",
        "",
    ],
)
def test_a_line_that_cannot_be_is_refused(line: str) -> None:
    with pytest.raises(ValueError, match="expected"):
        read_cells(line + "\n", 1)
