#pragma once

#include "Tracking/PassedSide.h"
#include "NarrowPhase/NarrowPhase.h"
#include "Core/Buffer.h"

#include <cstddef>
#include <cstdint>
#include <span>

namespace palpate {

/// The sides of one pair within a step: those that last from its start, and those of passages
/// within it. Each slides along the features on its way to the step's end.
class SideCourses {
 public:
  /// A side, and the features along which it slides.
  struct Course {
    PassedSide side;  ///< at the step's end
    double time;      ///< of the passage; 0: the step began so
    bool hasPassed;
    std::size_t first, count;  ///< of visited()
    std::uint32_t next;        ///< in the list of its features
  };

  void clear() noexcept;
  /// Begins the courses of the sides at the step's start that last. passages: how many will be
  /// taken.
  void start(const MeshPair&, std::span<const PassedSide>, std::size_t passages);
  /// A passage undoes that of a side next to it in the other direction. One in the same direction
  /// is the same passage, through a common edge or vertex.
  void take(const MeshPair&, const Crossing&);

  std::span<const PassedSide> atStart() const { return m_here; }
  /// First those of atStart(), in their order.
  std::span<const Course> all() const { return m_courses; }
  /// The features along which a side slides.
  std::span<const PassedSide> visited(const Course& course) const {
    return std::span(m_visited).subspan(course.first, course.count);
  }
  ContactKind ofSecond() const { return m_ofSecond; }  ///< of the second mesh's vertices
  /// Whether f(index of a course) is true for any course of the vertex, or of edges.
  template <class F>
  bool anyCourse(const Crossing& features, F&& f) const {
    const bool ofB = features.kind == ContactKind::TriangleVertex;
    for (std::uint32_t i = m_heads[listOf(features)]; i != kNoElement; i = m_courses[i].next) {
      const Crossing& own = m_courses[i].side.passage;
      if (own.kind == features.kind && (isEdges(own) || own.ids[ofB] == features.ids[ofB]) && f(i))
        return true;
    }
    return false;
  }
  /// The side to which a vertex had passed when the step began; null if it had not. kind: of
  /// vertices of its mesh.
  const PassedSide* sideAtStart(ContactKind, std::uint32_t vertex) const;
  /// Whether a contact of these features ends because a side has one of its own instead: what had
  /// passed when the step began has one at its place. What passes within the step keeps that of the
  /// features through which it passes, and those before.
  bool replaces(const MeshPair&, const PassedSide& features, double time) const;
  /// Whether a vertex passed into a body and out of it elsewhere, and vertices of the body passed
  /// the vertex' surface there. What these remember leads both back; the sides of the vertex would
  /// lead it into the body.
  bool isOfPassedBody(const MeshPair&, const Course&) const;

  void releaseMemory();

 private:
  std::size_t listOf(const Crossing&) const;
  bool contains(const MeshPair&, const Course&, const PassedSide&, bool* isSame = nullptr) const;
  bool hasPassedEnd(const Crossing&) const;
  /// Returns whether the passage is one of courses that are known.
  bool takeByEdges(const MeshPair&, const PassedSide&);
  bool takeByVertex(const MeshPair&, const PassedSide&);
  void add(const MeshPair&, const PassedSide&, double time);

  Buffer<PassedSide> m_here;    ///< those at the step's start that last
  Buffer<Crossing> m_returned;  ///< scratch of start(): passages of vertices in front again
  Buffer<Course> m_courses;
  Buffer<PassedSide> m_visited;
  Buffer<std::uint32_t> m_heads;  ///< of lists of m_courses: by the vertex, the last one of edges
  ContactKind m_ofSecond = ContactKind::TriangleVertex;
};

}  // namespace palpate
