#include <palpate/MeshFiles.h>
#include <palpate/OctreeBasedCD.h>

#include <cstdio>
#include <fstream>

int main() {
  std::ofstream("Quad.obj") << "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n";
  const palpate::MeshArrays quad = palpate::readMeshFile("Quad.obj");
  std::printf("%zu vertices, %zu triangles\n", quad.positions.size(), quad.triangles.size());
  palpate::OctreeBasedCD().addTriangleMesh(quad.positions, quad.triangles);
  try {
    palpate::readMeshFile("Missing.obj");
  } catch (const palpate::Error& error) {  // thrown by one library, caught by another's class
    std::puts(error.what());
    return quad.triangles.size() == 2 && error.code() == palpate::ErrorCode::File ? 0 : 1;
  }
  return 1;
}
