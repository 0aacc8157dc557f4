#pragma once

#include "MeshFiles/MeshBuilder.h"

#include <palpate/MeshFiles.h>

#include <array>
#include <string>
#include <vector>

namespace palpate::files {

// A reader and a writer for each format. A reader takes the file's content, and throws FileFault if
// that is malformed. A writer takes arrays that are valid and that its format can hold.

void readObj(FileText, MeshBuilder&);
void readPly(FileText, MeshBuilder&);
void readStl(FileText, MeshBuilder&);
void readLegacyVtk(FileText, MeshBuilder&);
void readVtp(FileText, MeshBuilder&);
void readVtu(FileText, MeshBuilder&);
void readGmsh(FileText, MeshBuilder&);
void readMedit(FileText, MeshBuilder&);

std::string writeObj(const MeshArrays&, const MeshWriteSettings&);
std::string writePly(const MeshArrays&, const MeshWriteSettings&);
std::string writeStl(const MeshArrays&, const MeshWriteSettings&);
std::string writeLegacyVtk(const MeshArrays&, const MeshWriteSettings&);
std::string writeVtp(const MeshArrays&, const MeshWriteSettings&);
std::string writeVtu(const MeshArrays&, const MeshWriteSettings&);
std::string writeGmsh(const MeshArrays&, const MeshWriteSettings&);
std::string writeMedit(const MeshArrays&, const MeshWriteSettings&);

/// Points as the elements of other kinds are: arrays of vertices.
inline std::vector<std::array<std::uint32_t, 1>> pointElements(const MeshArrays& mesh) {
  std::vector<std::array<std::uint32_t, 1>> elements;
  elements.reserve(mesh.points.size());
  for (const std::uint32_t point : mesh.points) elements.push_back({point});
  return elements;
}

/// What a reader makes of a file's content. Throws FileFault also for a mesh without elements.
MeshArrays meshOf(void (*reader)(FileText, MeshBuilder&), std::string_view content);

}  // namespace palpate::files
