#pragma once

#include "DistanceField/FieldCells.h"

#include <filesystem>

namespace palpate {

// Files of distance fields: binary, little endian, with a version and a checksum.
//
//   offset  bytes  content
//   0       16     "palpate-field" and three bytes 0
//   16      4      version
//   20      4      exponent, signed
//   24      8      error bound, double
//   32      8      band, double
//   40      24     origin: three signed integers
//   64      12     size: three integers
//   76      4      0
//   80      8      number of blocks
//   88      8      number of leaves
//   96             entries of the roots, 4 bytes each; blocks, 32 bytes each; leaves, 32 bytes each
//   end - 8  8     checksum: FNV-1a of all bytes before it, 64 bits

/// Writes a file, completely or not at all. Throws File.
void writeField(const FieldCells&, const std::filesystem::path&);
/// Throws File for any fault, with the file and the byte.
FieldCells readField(const std::filesystem::path&);

}  // namespace palpate
