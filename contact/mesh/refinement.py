"""Uniform refinement, which hands down parts and regions."""

from dataclasses import replace

import numpy as np
from dolfinx import mesh as dmesh

from contact import _compat
from contact.mesh.domain import Domain, exterior_facets, with_names


def refined(domain: Domain) -> Domain:
    """Cut every edge in two; parts and regions are inherited. Collective.

    The cells of the new mesh lie in the cells of the old one, on the same rank. A curved
    boundary keeps its old straight facets.
    """
    coarse = domain.mesh
    tdim = coarse.topology.dim
    coarse.topology.create_entities(1)
    # Without a partitioner the refined cells stay on the rank of their parent.
    fine, parent_cells, parent_facets = dmesh.refine(
        coarse, partitioner=None, option=dmesh.RefinementOption.parent_cell_and_facet
    )
    facets = exterior_facets(fine)
    coarse_facets = coarse.topology.connectivity(tdim, tdim - 1).array.reshape(-1, tdim + 1)
    fine_facets = fine.topology.connectivity(tdim, tdim - 1).array.reshape(-1, tdim + 1)

    # dolfinx.mesh.transfer_meshtag does the same, but refuses ghosted parents.
    # The parents are listed in the order in which the refined cells were made.
    made = _compat.original_cells(fine) - fine.topology.index_map(tdim).local_range[0]
    parent = parent_cells[made]
    local = parent_facets.reshape(-1, tdim + 1)[made]
    cells, places = np.nonzero(local >= 0)
    owner = np.full(fine_facets.max(initial=-1) + 1, -1, dtype=np.int32)
    owner[fine_facets[cells, places]] = coarse_facets[parent[cells], local[cells, places]]

    parts = {name: facets[np.isin(owner[facets], old)] for name, old in domain.parts.items()}
    owned = parent[: fine.topology.index_map(tdim).size_local]
    regions = {
        name: np.flatnonzero(np.isin(owned, old)).astype(np.int32)
        for name, old in domain.regions.items()
    }
    made_of = with_names(fine, parts, regions, domain.size)
    return replace(
        made_of,
        levels=domain.levels + 1,
        unusable=domain.unusable,
        notes=domain.notes,
        revolved=domain.revolved,
    )
