// Files of VTK's own writers, in every mode of these, and VTK's readers on files of
// writeMeshFile().
#include <palpate/MeshFiles.h>
#include <palpate/vtk/DataSets.h>

#include "Common/TemporaryFolder.h"

#include <gtest/gtest.h>
#include <vtkCellArray.h>
#include <vtkDoubleArray.h>
#include <vtkErrorCode.h>
#include <vtkNew.h>
#include <vtkPLYReader.h>
#include <vtkPLYWriter.h>
#include <vtkPointData.h>
#include <vtkPolyData.h>
#include <vtkPolyDataReader.h>
#include <vtkPolyDataWriter.h>
#include <vtkSTLReader.h>
#include <vtkSTLWriter.h>
#include <vtkSmartPointer.h>
#include <vtkUnstructuredGrid.h>
#include <vtkUnstructuredGridReader.h>
#include <vtkUnstructuredGridWriter.h>
#include <vtkXMLPolyDataReader.h>
#include <vtkXMLPolyDataWriter.h>
#include <vtkXMLUnstructuredGridReader.h>
#include <vtkXMLUnstructuredGridWriter.h>

#include <filesystem>
#include <random>

namespace palpate::vtk {
namespace {

/// A mesh of all kinds of elements, which fill more than one compressed block.
class MeshFilesByVtk : public ::testing::Test {
 protected:
  MeshFilesByVtk() {
    std::mt19937 random(1);
    std::uniform_int_distribution<int> coordinate(-4096, 4096);
    for (std::uint32_t v = 0; v < kVertices; ++v) {  // of few digits: text and floats keep no more
      Eigen::Vector3d& p = surface.positions.emplace_back();
      for (double& x : p) x = coordinate(random) / 64.0;
    }
    for (std::uint32_t v = 0; v < kVertices; v += 3) surface.triangles.push_back({v, v + 1, v + 2});
    lines = surface;
    lines.points = {0, 7, 9};
    lines.segments = {{3, 4}, {4, 9}};
    solid = lines;
    for (std::uint32_t v = 0; v < kVertices; v += 4)
      solid.tetrahedra.push_back({v, v + 1, v + 2, v + 3});
  }

  static void expectEqual(const MeshArrays& read, const MeshArrays& written) {
    EXPECT_TRUE(read.positions == written.positions);
    EXPECT_TRUE(read.triangles == written.triangles);
    EXPECT_TRUE(read.tetrahedra == written.tetrahedra);
    EXPECT_TRUE(read.segments == written.segments);
    EXPECT_TRUE(read.points == written.points);
  }

  template <class Writer, class Set>
  void expectReads(Writer& writer, Set& set, const char* kind, const MeshArrays& mesh,
                   const MeshReadSettings& settings = {}) {
    vtkNew<vtkDoubleArray> field;
    field->SetName("field");
    field->SetNumberOfTuples(kVertices);
    field->Fill(0.5);
    set.GetPointData()->AddArray(field);
    path.replace_extension(kind);
    writer.SetFileName(path.c_str());
    writer.SetInputData(&set);
    ASSERT_EQ(writer.Write(), 1);
    expectEqual(readMeshFile(path, settings), mesh);
  }

  template <class Writer, class Set>
  void expectReadsXml(Set& set, const char* kind, const MeshArrays& mesh) {
    for (const int mode : {Writer::Ascii, Writer::Binary, Writer::Appended})
      for (const int encoded : {0, 1})
        for (const int compressor : {Writer::NONE, Writer::ZLIB, Writer::LZ4})
          for (const int header : {Writer::UInt32, Writer::UInt64})
            for (const int order : {Writer::LittleEndian, Writer::BigEndian}) {
              SCOPED_TRACE(::testing::Message()
                           << mode << encoded << compressor << header << order);
              vtkNew<Writer> writer;
              writer->SetDataMode(mode);
              writer->SetEncodeAppendedData(encoded);
              writer->SetCompressorType(compressor);
              writer->SetHeaderType(header);
              writer->SetByteOrder(order);
              expectReads(*writer, set, kind, mesh);
            }
  }

  template <class Writer, class Set>
  void expectReadsLegacy(Set& set, const MeshArrays& mesh) {
    for (const int version : {vtkDataWriter::VTK_LEGACY_READER_VERSION_4_2,
                              vtkDataWriter::VTK_LEGACY_READER_VERSION_5_1})
      for (const int type : {VTK_ASCII, VTK_BINARY}) {
        SCOPED_TRACE(::testing::Message() << version << type);
        vtkNew<Writer> writer;
        writer->SetFileVersion(version);
        writer->SetFileType(type);
        expectReads(*writer, set, ".vtk", mesh);
      }
  }

  template <class Reader>
  void expectReadByVtk(const char* kind, const MeshArrays& mesh) {
    path.replace_extension(kind);
    for (const bool isBinary : {false, true}) {
      SCOPED_TRACE(isBinary);
      writeMeshFile(path, mesh, {.binary = isBinary});
      vtkNew<Reader> reader;
      reader->SetFileName(path.c_str());
      reader->Update();
      EXPECT_EQ(reader->GetErrorCode(), vtkErrorCode::NoError);
      expectEqual(toMeshArrays(*reader->GetOutput()), mesh);
    }
  }

  static constexpr std::uint32_t kVertices = 1500;
  testing::TemporaryFolder folder;
  std::filesystem::path path = folder.path / "mesh";
  MeshArrays surface, lines, solid;
};

TEST_F(MeshFilesByVtk, XmlPolygonsOfVtkAreRead) {
  expectReadsXml<vtkXMLPolyDataWriter>(*toPolyData(lines), ".vtp", lines);
}

TEST_F(MeshFilesByVtk, XmlGridsOfVtkAreRead) {
  expectReadsXml<vtkXMLUnstructuredGridWriter>(*toUnstructuredGrid(solid), ".vtu", solid);
}

TEST_F(MeshFilesByVtk, LegacyFilesOfVtkAreRead) {
  expectReadsLegacy<vtkPolyDataWriter>(*toPolyData(lines), lines);
  expectReadsLegacy<vtkUnstructuredGridWriter>(*toUnstructuredGrid(solid), solid);
}

TEST_F(MeshFilesByVtk, StlAndPlyOfVtkAreRead) {
  const vtkSmartPointer<vtkPolyData> data = toPolyData(surface);
  for (const int type : {VTK_ASCII, VTK_BINARY}) {
    SCOPED_TRACE(type);
    vtkNew<vtkSTLWriter> stl;
    stl->SetFileType(type);
    expectReads(*stl, *data, ".stl", surface, {.weldDistance = 0.0});
    vtkNew<vtkPLYWriter> ply;
    ply->SetFileType(type);
    expectReads(*ply, *data, ".ply", surface);
  }
}

TEST_F(MeshFilesByVtk, VtkReadsWhatIsWritten) {
  expectReadByVtk<vtkXMLPolyDataReader>(".vtp", lines);
  expectReadByVtk<vtkXMLUnstructuredGridReader>(".vtu", solid);
  expectReadByVtk<vtkPolyDataReader>(".vtk", lines);
  expectReadByVtk<vtkUnstructuredGridReader>(".vtk", solid);
  expectReadByVtk<vtkPLYReader>(".ply", surface);
  expectReadByVtk<vtkSTLReader>(".stl", surface);
}

/// Doubles that floats do not hold.
TEST_F(MeshFilesByVtk, VtkReadsTheSameBits) {
  std::mt19937_64 random(5);
  std::uniform_real_distribution<double> coordinate(-1, 1);
  for (Eigen::Vector3d& p : solid.positions)
    for (double& x : p) x = coordinate(random);
  lines.positions = solid.positions;
  expectReadByVtk<vtkXMLPolyDataReader>(".vtp", lines);
  expectReadByVtk<vtkXMLUnstructuredGridReader>(".vtu", solid);
  expectReadByVtk<vtkUnstructuredGridReader>(".vtk", solid);
}

}  // namespace
}  // namespace palpate::vtk
