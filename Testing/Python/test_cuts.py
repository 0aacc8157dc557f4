"""replace_triangles(), replace_tetrahedra() and set_tags()."""

import numpy as np
import pytest

import palpate

CORNERS = np.array([[0, 0, 0], [10, 0, 0], [0, 10, 0], [10, 10, 0]], float)
TRIANGLES = np.array([[0, 1, 2], [1, 3, 2]])


def test_a_cut_keeps_ids_and_tags():
    collisions = palpate.OctreeBasedCD()
    sheet = collisions.add_triangle_mesh(CORNERS, TRIANGLES)
    tips = collisions.add_point_set(np.array([[3, 2, 0.1], [7, 8, 0.1]]))
    collisions.add_collision_pair(tips, sheet, thickness=0.2)
    collisions.set_tags(sheet, [4, 5])
    ids = collisions.replace_triangles(sheet, [0], [[0, 1, 4]], [[5, 5, 0]])
    assert ids.tolist() == [2]
    assert collisions.removed_elements(sheet).tolist() == [0]
    assert collisions.tags(sheet).tolist() == [4, 5, 0]
    assert len(collisions.positions(sheet)) == 5
    seen = []
    collisions.set_contact_predicate(tips, sheet, lambda f: seen.append((f.b[0], f.tag_b)) or True)
    collisions.detect_collision()
    data = collisions.collision_data(tips, sheet)
    assert data.vertex_triangle["triangle"].tolist() == [2, 1]
    assert data.tags(palpate.ContactKind.VERTEX_TRIANGLE).tolist() == [[0, 0], [0, 5]]
    assert data.tags(palpate.ContactKind.EDGE_EDGE).shape == (0, 2)
    assert {(2, 0), (1, 5)} <= set(seen)
    collisions.publish()
    assert collisions.latest_snapshot().tags(sheet).tolist() == [4, 5, 0]
    geometry = collisions.problem().geometries[0]
    assert (geometry.removed.tolist(), geometry.tags.tolist()) == ([0], [4, 5, 0])
    with pytest.raises(palpate.Error, match="triangle 0 was removed before"):
        collisions.replace_triangles(sheet, [0], [])
    with pytest.raises(palpate.Error, match="2 tags given, but it has 3 elements"):
        collisions.set_tags(sheet, [1, 2])


def test_a_cut_of_tetrahedra():
    positions = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1]], float)
    collisions = palpate.OctreeBasedCD()
    tissue = collisions.add_tetrahedral_mesh(positions, [[0, 1, 2, 3], [1, 2, 3, 4]])
    before = collisions.surface(tissue)
    assert collisions.replace_tetrahedra(tissue, [0], []).tolist() == []
    after = collisions.surface(tissue)
    assert collisions.removed_elements(tissue).tolist() == [0, 1, 2]
    assert np.array_equal(after.triangles[3:6], before.triangles[3:])
    assert after.tetrahedra.tolist() == 3 * [palpate.NO_ELEMENT] + 4 * [1]
    moved = positions[:1] - 0.5
    rest = positions[:1]
    assert collisions.replace_tetrahedra(tissue, [], [[1, 2, 3, 5]], moved, rest).tolist() == [2]
    assert collisions.problem().geometries[0].removed_tetrahedra.tolist() == [0]
