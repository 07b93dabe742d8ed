"""Result and scratch arrays of the search over the surface."""

from typing import Annotated, NamedTuple

from contactsense.localization.surface.simd_layout import BOUND, LENGTH
from contactsense.robots.jit.declaration import Floats, Integers
from contactsense.robots.jit.lanes import LANES


class SurfaceCells(NamedTuple):
    """Cells that the search over the surface evaluates, one per row: samples and subsamples."""

    score: Annotated[Floats, "cells"]
    """Log evidence; -infinity if the cell is rejected or already merged."""
    point: Annotated[Floats, "cells, 3"]
    """Most probable contact point in the cell, link frame [m]."""
    normal: Annotated[Floats, "cells, 3"]
    """Outward unit normal, link frame."""
    force: Annotated[Floats, "cells, 3"]
    """Most probable force there, link frame [N]."""
    covariance: Annotated[Floats, "cells, 6"]
    """Covariance of the point within the cell (xx, xy, xz, yy, yz, zz), link frame [m^2]."""
    spread: Annotated[Floats, "cells"]
    """Standard deviation of the cell along each tangent [m]."""
    torsion: Annotated[Floats, "cells"]
    """Most probable torsion there [Nm]."""
    weight: Annotated[Floats, "cells"]
    """Weight in the candidate that is being built, relative to its first cell; 0 for the cells of others."""
    members: Annotated[Floats, "4, cells"]
    """Cells of that candidate: displacement x, y, z from its posterior mode, link frame [m], and weight."""
    wrench: Annotated[Floats, "6"]
    """Fused wrench in the frame of one link [N, Nm]."""
    information: Annotated[Floats, "6, 6"]
    """Its information matrix."""
    unassigned_evidence: Annotated[Floats, "links"]
    """Log evidence on each link that is not part of any candidate."""
    link_energy: Annotated[Floats, "links"]
    """Energy of each link's hypothesis less the log density of places on it."""
    bound_block: Annotated[Floats, f"{BOUND + LANES}"]
    """Block of cells for `contactsense.localization.surface_search.energy_bound`."""
    mode_block: Annotated[Floats, f"{LENGTH}"]
    """Block of cells for `contactsense.localization.surface_search.laplace_evidence`."""
    bound: Annotated[Floats, "cells"]
    """Lower bound of the energy of each cell in `queue`."""
    queue: Annotated[Integers, "cells"]
    """Samples of one link that the bound does not exclude."""
    chosen: Annotated[Integers, "cells"]
    """Those of `queue` that are evaluated next."""
    mode_sample: Annotated[Integers, f"{LANES}"]
    """Sample or subsample of each cell in `mode_block`."""
    primitive: Annotated[Integers, "cells"]
    """Primitive of each row."""
    sample: Annotated[Integers, "cells"]
    """Sample of each row; undefined for subsamples."""
