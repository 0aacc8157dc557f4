#pragma once

// Geometries with the names and public signatures of iMSTK 7.0, as far as the adapter and its tests
// call them, with enough behaviour to run them. CMakeLists.txt gives these files iMSTK's names.

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <Eigen/StdVector>

#include <functional>
#include <memory>
#include <sstream>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#define IMSTK_TYPE_NAME(name)                                    \
  static const std::string getStaticTypeName() { return #name; } \
  const std::string getTypeName() const override { return #name; }

namespace imstk {

using Vec3d = Eigen::Vector3d;
using Mat3d = Eigen::Matrix3d;
using Quatd = Eigen::Quaterniond;
using StdVectorOfQuatd = std::vector<Quatd, Eigen::aligned_allocator<Quatd>>;
using StdVectorOfMat3d = std::vector<Mat3d, Eigen::aligned_allocator<Mat3d>>;
using CellTypeId = unsigned char;
#define IMSTK_VERTEX 0
#define IMSTK_EDGE 1
#define IMSTK_TRIANGLE 2

/// What LOG() wrote, for tests.
inline std::vector<std::string>& logged() {
  static std::vector<std::string> messages;
  return messages;
}
struct LogLine {
  std::ostringstream stream;
  ~LogLine() { logged().push_back(stream.str()); }
};
#define LOG(level) \
  if (false) {     \
  } else           \
    ::imstk::LogLine().stream

namespace ParallelUtils {
struct ThreadManager {
  static size_t getThreadPoolSize() { return 2; }
};
}  // namespace ParallelUtils

template <class T>
class DataArray {
 public:
  std::vector<T> values;
  int size() const { return static_cast<int>(values.size()); }
  T& operator[](const size_t i) { return values[i]; }
  const T& operator[](const size_t i) const { return values[i]; }
};

template <class T, int N>
class VecDataArray {
 public:
  using ValueType = Eigen::Matrix<T, N, 1>;
  std::vector<ValueType> values;
  VecDataArray() = default;
  explicit VecDataArray(std::vector<ValueType> items) : values(std::move(items)) {}
  ValueType* getPointer() { return values.data(); }  // as iMSTK's, not const
  int size() const { return static_cast<int>(values.size()); }
  ValueType& operator[](const size_t i) { return values[i]; }
  const ValueType& operator[](const size_t i) const { return values[i]; }
};

class Geometry {
 public:
  enum class DataType { PreTransform, PostTransform };
  virtual ~Geometry() = default;
  virtual const std::string getTypeName() const = 0;
  void setTranslation(const Vec3d& t) {
    m_translation = t;
    m_isPlaced = true;
  }
  void setRotation(const Quatd& r) {
    m_rotation = r;
    m_isPlaced = true;
  }

 protected:
  Vec3d m_translation = Vec3d::Zero();
  Quatd m_rotation = Quatd::Identity();
  bool m_isPlaced = false;
};

class PointSet : public Geometry {
 public:
  IMSTK_TYPE_NAME(PointSet)
  void initialize(std::shared_ptr<VecDataArray<double, 3>> positions) {
    m_initial = std::make_shared<VecDataArray<double, 3>>(*positions);
    m_positions = positions;
  }
  std::shared_ptr<VecDataArray<double, 3>> getInitialVertexPositions() const { return m_initial; }
  std::shared_ptr<VecDataArray<double, 3>> getVertexPositions(
      DataType type = DataType::PostTransform) const {
    if (type == DataType::PreTransform) return m_initial;
    if (m_isPlaced)
      for (size_t i = 0; i < m_initial->values.size(); ++i)
        (*m_positions)[i] = m_rotation * (*m_initial)[i] + m_translation;
    return m_positions;
  }

 private:
  std::shared_ptr<VecDataArray<double, 3>> m_initial, m_positions;
};

class AbstractCellMesh : public PointSet {};

template <int N>
class CellMesh : public AbstractCellMesh {
 public:
  void initialize(std::shared_ptr<VecDataArray<double, 3>> vertices,
                  std::shared_ptr<VecDataArray<int, N>> cells) {
    PointSet::initialize(vertices);
    m_cells = cells;
  }
  std::shared_ptr<VecDataArray<int, N>> getCells() const { return m_cells; }
  void setCells(std::shared_ptr<VecDataArray<int, N>> cells) { m_cells = cells; }

 private:
  std::shared_ptr<VecDataArray<int, N>> m_cells;
};
struct LineMesh : CellMesh<2> {
  IMSTK_TYPE_NAME(LineMesh)
};
struct SurfaceMesh : CellMesh<3> {
  IMSTK_TYPE_NAME(SurfaceMesh)
};
struct TetrahedralMesh : CellMesh<4> {
  IMSTK_TYPE_NAME(TetrahedralMesh)
};
struct HexahedralMesh : CellMesh<8> {
  IMSTK_TYPE_NAME(HexahedralMesh)
};

class AnalyticalGeometry : public Geometry {
 public:
  Vec3d getPosition(DataType type = DataType::PostTransform) {
    return type == DataType::PreTransform ? m_position : m_rotation * m_position + m_translation;
  }
  void setPosition(const Vec3d p) { m_position = p; }
  Quatd getOrientation(DataType type = DataType::PostTransform) {
    return type == DataType::PreTransform ? m_orientation : m_rotation * m_orientation;
  }
  void setOrientation(const Quatd r) { m_orientation = r; }

 protected:
  Vec3d m_position = Vec3d::Zero();
  Quatd m_orientation = Quatd::Identity();
};

class Sphere : public AnalyticalGeometry {
 public:
  explicit Sphere(const Vec3d& pos = Vec3d::Zero(), const double radius = 1.0) : m_radius(radius) {
    setPosition(pos);
  }
  IMSTK_TYPE_NAME(Sphere)
  double getRadius(DataType = DataType::PostTransform) { return m_radius; }

 private:
  double m_radius;
};

class Capsule : public AnalyticalGeometry {
 public:
  explicit Capsule(const Vec3d& pos = Vec3d::Zero(), const double radius = 0.5,
                   const double length = 1.0, const Quatd orientation = Quatd::Identity())
      : m_radius(radius), m_length(length) {
    setPosition(pos);
    setOrientation(orientation);
  }
  IMSTK_TYPE_NAME(Capsule)
  double getRadius(DataType = DataType::PostTransform) { return m_radius; }
  double getLength(DataType = DataType::PostTransform) { return m_length; }

 private:
  double m_radius, m_length;
};

class Cylinder : public AnalyticalGeometry {
 public:
  IMSTK_TYPE_NAME(Cylinder)
  double getRadius(DataType = DataType::PostTransform) { return 1.0; }
  double getLength(DataType = DataType::PostTransform) { return 1.0; }
};

class OrientedBox : public AnalyticalGeometry {
 public:
  IMSTK_TYPE_NAME(OrientedBox)
  Vec3d getExtents(DataType = DataType::PostTransform) { return {0.5, 0.5, 0.5}; }
};

class Plane : public AnalyticalGeometry {
 public:
  explicit Plane(const Vec3d& pos = Vec3d::Zero(), const Vec3d& normal = Vec3d::UnitY())
      : m_normal(normal) {
    setPosition(pos);
  }
  IMSTK_TYPE_NAME(Plane)
  Vec3d getNormal(DataType type = DataType::PostTransform) {
    return type == DataType::PreTransform ? m_normal : m_rotation * m_normal;
  }

 private:
  Vec3d m_normal;
};

class GeometryMap {
 public:
  virtual ~GeometryMap() = default;
  virtual void update() = 0;
};

class PointwiseMap : public GeometryMap {
 public:
  PointwiseMap(std::shared_ptr<Geometry> parent, std::shared_ptr<Geometry> child)
      : m_parent(parent), m_child(child) {}
  void setMap(const std::unordered_map<int, int>& map) { m_map = map; }  // child to parent
  int getParentVertexId(const int child) const {
    return m_map.count(child) == 0 ? -1 : m_map.at(child);
  }
  void update() override {
    auto& from = *std::dynamic_pointer_cast<PointSet>(m_parent)->getVertexPositions();
    auto& to = *std::dynamic_pointer_cast<PointSet>(m_child)->getVertexPositions();
    for (const auto& pair : m_map)
      to[static_cast<size_t>(pair.first)] = from[static_cast<size_t>(pair.second)];
  }

 private:
  std::shared_ptr<Geometry> m_parent, m_child;
  std::unordered_map<int, int> m_map;
};

}  // namespace imstk
