"""Arrays that go in: without a copy where possible, converted and checked otherwise."""

import tracemalloc

import numpy as np
import pytest

import palpate
from scenes import BLADE, BLADE_TRIANGLES, TETRAHEDRON, TETRAHEDRON_TRIANGLES, ball


def test_positions_of_other_types_are_converted():
    positions, triangles = ball(8)
    collisions = palpate.OctreeBasedCD()
    for given in (
        positions,
        positions.tolist(),
        np.asfortranarray(positions),
        np.repeat(positions, 2, axis=0)[::2],
        np.pad(positions, ((0, 0), (0, 2)))[:, :3],
        positions.astype(">f8"),
    ):
        mesh = collisions.add_triangle_mesh(given, triangles)
        assert np.array_equal(collisions.positions(mesh), positions)
    mesh = collisions.add_triangle_mesh(positions.astype(np.float32), triangles)
    assert np.array_equal(collisions.positions(mesh), positions.astype(np.float32))
    mesh = collisions.add_triangle_mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    assert collisions.positions(mesh).dtype == np.float64


def test_unaligned_positions_are_converted():
    positions, triangles = ball(8)
    memory = np.zeros(positions.nbytes + 1, dtype=np.uint8)
    unaligned = memory[1:].view(np.float64).reshape(positions.shape)
    unaligned[:] = positions
    assert not unaligned.flags.aligned
    collisions = palpate.OctreeBasedCD()
    mesh = collisions.add_triangle_mesh(unaligned, triangles)
    assert np.array_equal(collisions.positions(mesh), positions)


@pytest.mark.parametrize("convert", [False, True])
def test_float64_positions_are_not_copied(convert):
    positions, triangles = ball(100)
    collisions = palpate.OctreeBasedCD()
    mesh = collisions.add_triangle_mesh(positions, triangles)
    given = positions.astype(np.float32) if convert else positions
    tracemalloc.start()  # NumPy reports the memory of arrays
    collisions.set_positions(mesh, given)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert (peak > positions.nbytes / 2) == convert


def test_uint32_indices_are_not_copied():
    positions, triangles = ball(100)
    collisions = palpate.OctreeBasedCD()
    tracemalloc.start()
    collisions.add_triangle_mesh(positions, triangles)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < triangles.nbytes / 2


@pytest.mark.parametrize("kind", ["i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8", ">i4", "object"])
def test_integers_of_any_width(kind):
    collisions = palpate.OctreeBasedCD()
    mesh = collisions.add_triangle_mesh(TETRAHEDRON, TETRAHEDRON_TRIANGLES.astype(kind))
    assert np.array_equal(collisions.problem().geometries[mesh].triangles, TETRAHEDRON_TRIANGLES)


@pytest.mark.parametrize(
    "index", [-1, -(2**31), -(2**63), 2**32, 2**63 - 1, 2**63, 2**64, -(2**64)]
)
def test_indices_beyond_32_bits_are_refused_with_their_place(index):
    collisions = palpate.OctreeBasedCD()
    triangles = [[0, 1, 2], [0, 2, 3], [1, index, 2]]
    message = f"Entry 2 of triangles has the index {index}"
    with pytest.raises(palpate.Error, match=message) as caught:
        collisions.add_triangle_mesh(TETRAHEDRON, triangles)
    assert caught.value.code == palpate.ErrorCode.INDEX_OUT_OF_RANGE
    assert caught.value.element == 2
    assert not collisions.has(0)


def test_indices_of_vertices_that_do_not_exist():
    with pytest.raises(palpate.Error) as caught:
        palpate.OctreeBasedCD().add_triangle_mesh(BLADE, [[0, 1, 2], [0, 1, 3]])
    assert caught.value.code is palpate.ErrorCode.INDEX_OUT_OF_RANGE
    assert (caught.value.geometry, caught.value.element) == (0, 1)


@pytest.mark.parametrize("shape", [(3,), (4, 2), (4, 4), (2, 2, 3), ()])
def test_positions_of_another_shape_are_refused(shape):
    with pytest.raises(palpate.Error) as caught:
        palpate.OctreeBasedCD().add_triangle_mesh(np.zeros(shape), BLADE_TRIANGLES)
    assert caught.value.code is palpate.ErrorCode.WRONG_POSITION_COUNT


@pytest.mark.parametrize(
    "positions", ["abc", [["a", "b", "c"]], [[1j, 2, 3]], None, [[object()] * 3]]
)
def test_what_holds_no_numbers_is_refused(positions):
    with pytest.raises(TypeError):
        palpate.OctreeBasedCD().add_triangle_mesh(positions, BLADE_TRIANGLES)


@pytest.mark.parametrize(
    "triangles", [[[0.0, 1.0, 2.0]], [["a", "b", "c"]], [[True, False, True]]]
)
def test_what_holds_no_integers_is_refused(triangles):
    with pytest.raises(TypeError):
        palpate.OctreeBasedCD().add_triangle_mesh(BLADE, triangles)


def test_empty_meshes():
    collisions = palpate.OctreeBasedCD()
    for positions, triangles in ([], []), (np.zeros((0, 3)), np.zeros((0, 3), int)), (BLADE, []):
        mesh = collisions.add_triangle_mesh(positions, triangles)
        assert collisions.vertex_count(mesh) == len(positions)
    assert collisions.positions(0).shape == (0, 3)


def test_positions_that_are_not_finite():
    positions = BLADE.copy()
    positions[1, 2] = np.nan
    with pytest.raises(palpate.Error) as caught:
        palpate.OctreeBasedCD().add_triangle_mesh(positions, BLADE_TRIANGLES)
    assert caught.value.code is palpate.ErrorCode.NON_FINITE_POSITION
    assert caught.value.element == 1


def test_ids_that_are_no_integers_or_unknown():
    collisions = palpate.OctreeBasedCD()
    mesh = collisions.add_triangle_mesh(BLADE, BLADE_TRIANGLES)
    assert collisions.vertex_count(np.uint8(mesh)) == 3
    with pytest.raises(TypeError):
        collisions.vertex_count(1.0)
    for unknown in (-1, 7, 2**32, 2**70):
        assert not collisions.has(unknown)
        with pytest.raises(palpate.Error) as caught:
            collisions.vertex_count(unknown)
        assert caught.value.code is palpate.ErrorCode.UNKNOWN_GEOMETRY


def test_radii():
    collisions = palpate.OctreeBasedCD()
    one = collisions.add_line_mesh(BLADE, [[0, 1], [1, 2]], 0.5)
    each = collisions.add_line_mesh(BLADE, [[0, 1], [1, 2]], [0.5, 0.25, 0.125])
    points = collisions.add_point_set(BLADE, np.float32(0.5))
    geometries = collisions.problem().geometries
    assert geometries[one].radii.tolist() == [0.5]
    assert geometries[each].radii.tolist() == [0.5, 0.25, 0.125]
    assert geometries[points].radii.tolist() == [0.5]
    with pytest.raises(palpate.Error) as caught:
        collisions.add_point_set(BLADE, [1.0, 2.0])
    assert caught.value.code is palpate.ErrorCode.INVALID_RADIUS


def test_meshes_by_the_conventions_of_trimesh_and_meshio():
    class Trimesh:
        vertices, faces = TETRAHEDRON, TETRAHEDRON_TRIANGLES

    class Block:
        def __init__(self, kind, data):
            self.type, self.data = kind, np.array(data)

    class Mesh:
        def __init__(self, *cells):
            self.points, self.cells = TETRAHEDRON, list(cells)

    collisions = palpate.OctreeBasedCD()
    added = [
        palpate.add(collisions, Trimesh()),
        palpate.add(collisions, Mesh(Block("triangle", [[0, 1, 2]]), Block("line", [[0, 1]]))),
        palpate.add(collisions, Mesh(("quad", np.array([[0, 1, 2, 3]])))),
        palpate.add(
            collisions, Mesh(Block("tetra", [[0, 1, 2, 3]]), Block("triangle", [[0, 1, 2]]))
        ),
        palpate.add(collisions, Mesh(Block("line", [[0, 1], [2, 3]])), radius=0.5),
        palpate.add(collisions, Mesh(Block("vertex", [[0]])), radius=0.5),
    ]
    kinds = [g.type for g in collisions.problem().geometries]
    T = palpate.GeometryType
    assert kinds == [T.TRIANGLES, T.TRIANGLES, T.TRIANGLES, T.TRIANGLES, T.LINES, T.POINTS]
    assert len(collisions.problem().geometries[added[2]].triangles) == 2
    assert len(collisions.surface(added[3]).triangles) == 4
    with pytest.raises(TypeError):
        palpate.add(collisions, object())
    with pytest.raises(palpate.Error):
        palpate.add(collisions, Mesh(Block("hexahedron", [[0] * 8])))
