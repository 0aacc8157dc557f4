#include "Scenes.h"

#include <cstdio>
#include <fstream>

/// Writes the organs at rest into a folder that exists, as in Data/Organs.
int main(int count, char** arguments) {
  if (count != 2) {
    std::fprintf(stderr, "usage: PalpateWriteOrgans FOLDER\n");
    return 1;
  }
  for (const auto& [name, mesh] : palpate::scenes::organMeshes()) {
    const std::string path = std::string(arguments[1]) + "/" + name + ".obj";
    std::ofstream file(path);
    file << palpate::scenes::organObj({name, mesh});
    if (!file.flush()) {
      std::fprintf(stderr, "%s cannot be written.\n", path.c_str());
      return 1;
    }
  }
}
