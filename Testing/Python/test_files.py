"""Mesh files: what is written comes back with the same bits."""

import numpy as np
import pytest

import palpate
from scenes import TETRAHEDRON, TETRAHEDRON_TRIANGLES, same

POSITIONS = TETRAHEDRON + [0.1, 1 / 3, 1e-300]


@pytest.mark.parametrize("suffix", ["obj", "ply", "vtk", "vtp", "vtu", "msh", "mesh"])
@pytest.mark.parametrize("binary", [False, True])
def test_files_keep_all_bits(tmp_path, suffix, binary):
    path = tmp_path / f"mesh.{suffix}"
    mesh = palpate.MeshArrays(POSITIONS, TETRAHEDRON_TRIANGLES)
    palpate.write_mesh_file(path, mesh, binary=binary)
    read = palpate.read_mesh_file(str(path))
    assert same(read.positions, POSITIONS) and same(read.triangles, TETRAHEDRON_TRIANGLES)
    assert read.tetrahedra.shape == (0, 4) and read.segments.shape == (0, 2)
    assert read.points.shape == (0,) and read.joined_vertices == 0


def test_all_kinds_of_elements(tmp_path):
    for elements in (
        {"tetrahedra": [[0, 2, 1, 3]]},
        {"segments": [[0, 1], [1, 3]]},
        {"points": [0, 3]},
    ):
        (name,) = elements
        palpate.write_mesh_file(tmp_path / "mesh.vtu", palpate.MeshArrays(POSITIONS, **elements))
        read = palpate.read_mesh_file(tmp_path / "mesh.vtu")
        assert getattr(read, name).tolist() == elements[name] and len(read.triangles) == 0
        collisions = palpate.OctreeBasedCD()
        assert collisions.vertex_count(palpate.add(collisions, read)) == 4


def test_vertices_of_an_stl_file_are_joined(tmp_path):
    path = tmp_path / "mesh.stl"
    palpate.write_mesh_file(path, palpate.MeshArrays(TETRAHEDRON, TETRAHEDRON_TRIANGLES))
    assert len(palpate.read_mesh_file(path).positions) == 12
    joined = palpate.read_mesh_file(path, weld_distance=0)
    assert repr(joined) == "<palpate.MeshArrays: 4 positions, 4 triangles>"
    assert len(joined.positions) == 4 and joined.joined_vertices == 8
    assert palpate.find_mesh_defects(joined.triangles).closed


def test_errors_name_the_place(tmp_path):
    path = tmp_path / "mesh.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n")
    with pytest.raises(palpate.Error) as caught:
        palpate.read_mesh_file(path)
    assert caught.value.code is palpate.ErrorCode.FILE
    assert "mesh.obj" in str(caught.value) and "line 4" in str(caught.value)
    with pytest.raises(palpate.Error) as caught:
        palpate.write_mesh_file(path, palpate.MeshArrays(np.zeros((2, 3)), [[0, 1, 2]]))
    assert caught.value.code is palpate.ErrorCode.INDEX_OUT_OF_RANGE
    assert path.read_text().startswith("v 0 0 0")
    with pytest.raises(TypeError):
        palpate.read_mesh_file(path, 0.0)
