// Palpate in C#, over the C interface <palpate/palpate_c.h>, which says what each function and member means. Put this
// file into your project and libPalpate where the run-time finds native libraries (in Unity: Assets/Plugins). It needs
// unsafe code ("Allow unsafe code" in Unity), System.Span, and 64 bits.
#pragma warning disable 0649  // the library assigns members of structs
using System;
using System.Runtime.InteropServices;

namespace Palpate {

public enum Method { Auto, Intersection, Proximity, Continuous, DistanceField, Proxy }
public enum ContactSet { Distinct, All }
public enum Sides { Both, Outer }
public enum ShapeKind { Sphere, Capsule, Plane, Box, Cylinder, Hull }

/// A call that failed: Status is a palpate_status, the message that of palpate_last_error().
public sealed class PalpateException : Exception {
  public readonly int Status;
  internal PalpateException(int status, string message) : base(message) { Status = status; }
}

public struct Vector {
  public double X, Y, Z;
  public Vector(double x, double y, double z) { X = x; Y = y; Z = z; }
}
public struct Triangle {
  public uint A, B, C;
  public Triangle(uint a, uint b, uint c) { A = a; B = b; C = c; }
}
public struct Tetrahedron {
  public uint A, B, C, D;
  public Tetrahedron(uint a, uint b, uint c, uint d) { A = a; B = b; C = c; D = d; }
}
public struct Segment {
  public uint A, B;
  public Segment(uint a, uint b) { A = a; B = b; }
}
public struct Weights4 { public double A, B, C, D; }

// Structs of C, member for member. Native names the struct for the test of sizes.
[AttributeUsage(AttributeTargets.Struct)]
public sealed class NativeAttribute : Attribute {
  public readonly string Name;
  public NativeAttribute(string name) { Name = name; }
}

[Native("palpate_settings")]
public struct Settings {
  internal UIntPtr Size;
  public UIntPtr MemoryLimit;
  public int MaxDepth, MaxElementsPerLeaf, OctreeUpdate, OctreeBounds, Engine, Threads;
  byte keepsPairs;
  public bool KeepsPairs { get { return keepsPairs != 0; } set { keepsPairs = value ? (byte)1 : (byte)0; } }
  public static Settings Default {
    get { Settings s; Native.Check(Native.palpate_init_settings(out s, Native.SizeOf<Settings>())); return s; }
  }
}
[Native("palpate_pair_settings")]
public struct PairSettings {
  internal UIntPtr Size;
  public double Thickness, RestDistance, AllowedError, FreeMotionReach, TimeTolerance, MotionTolerance, WidestNormalCone;
  public Method Method;
  public ContactSet Contacts;
  public int Priority;
  byte trackContacts, reportCrossings, smoothNormals, rememberSides, earliestTimeOnly;
  public bool TrackContacts { get { return trackContacts != 0; } set { trackContacts = value ? (byte)1 : (byte)0; } }
  public bool ReportCrossings {
    get { return reportCrossings != 0; } set { reportCrossings = value ? (byte)1 : (byte)0; }
  }
  public bool SmoothNormals { get { return smoothNormals != 0; } set { smoothNormals = value ? (byte)1 : (byte)0; } }
  public bool RememberSides { get { return rememberSides != 0; } set { rememberSides = value ? (byte)1 : (byte)0; } }
  public bool EarliestTimeOnly {
    get { return earliestTimeOnly != 0; } set { earliestTimeOnly = value ? (byte)1 : (byte)0; }
  }
  public static PairSettings Default {
    get {
      PairSettings s;
      Native.Check(Native.palpate_init_pair_settings(out s, Native.SizeOf<PairSettings>()));
      return s;
    }
  }
}
[Native("palpate_filter")]
public struct Filter {
  internal UIntPtr Size;
  public uint Groups, Mask;
  public Sides Sidedness;
  public static Filter Default {
    get { Filter f; Native.Check(Native.palpate_init_filter(out f, Native.SizeOf<Filter>())); return f; }
  }
}
/// R0, R1, R2: the rows of the rotation.
[Native("palpate_pose")]
public struct Pose {
  public Vector R0, R1, R2, Translation;
  public static Pose Identity {
    get { return new Pose { R0 = new Vector(1, 0, 0), R1 = new Vector(0, 1, 0), R2 = new Vector(0, 0, 1) }; }
  }
}
[Native("palpate_motion")]
public struct Motion { public Pose Before, Now; }
[Native("palpate_shape")]
public struct Shape {
  internal UIntPtr Size;
  public ShapeKind Kind;
  byte twoSided;
  public Vector P0, P1;
  public double Radius;
  internal IntPtr Points;
  internal UIntPtr PointCount;
  public bool TwoSided { get { return twoSided != 0; } set { twoSided = value ? (byte)1 : (byte)0; } }
}
[Native("palpate_pair")]
public struct Pair {
  public uint A, B;
}
[Native("palpate_vertex_triangle")]
public struct VertexTriangle {
  public uint Vertex, TriangleId;
  public Triangle Vertices;
  public Vector Weights, Normal;
  public double Distance, TimeOfImpact;
  public byte Feature;
}
[Native("palpate_edge_edge")]
public struct EdgeEdge {
  public Segment EdgeA, EdgeB;
  public double WeightA, WeightB;
  public Vector Normal;
  public double Distance, TimeOfImpact;
  public byte FeatureA, FeatureB;
}
[Native("palpate_shape_contact")]
public struct ShapeContact {
  public uint Element, Id;
  public Triangle Vertices;
  public Vector Weights, Point, PointOnShape, Normal;
  public double Distance, TimeOfImpact;
}
[Native("palpate_shape_shape")]
public struct ShapeShape {
  public Vector PointA, PointB, Normal;
  public double Distance, TimeOfImpact;
}
[Native("palpate_contacts")]
struct ContactViews {
  public UIntPtr Size;
  public IntPtr VertexTriangle; public UIntPtr VertexTriangleCount;
  public IntPtr TriangleVertex; public UIntPtr TriangleVertexCount;
  public IntPtr EdgeEdge; public UIntPtr EdgeEdgeCount;
  public IntPtr IntersectingTriangles; public UIntPtr IntersectingTriangleCount;
  public IntPtr Shape; public UIntPtr ShapeCount;
  public IntPtr ShapeShape; public UIntPtr ShapeShapeCount;
  public double ErrorBound;
}
[Native("palpate_indices")]
struct Indices { public IntPtr Data; public UIntPtr Count; }
[Native("palpate_validity")]
public struct Validity {
  internal UIntPtr Size;
  public UIntPtr AtEnd, AtImpact;
  public double Displacement, DisplacementLimit, ArcDeviation, EffectiveThickness, ProxyDepth;
  Indices untrustedVerticesA, untrustedVerticesB, degenerateTrianglesA, degenerateTrianglesB;
  Indices outsideBand, nearThreshold, unreliableSign;
  public Method Method;
  public int Reason;
  public uint Age;
  byte trusted, startedApart, sideMayBeWrong, unwelded;
  byte advanceMayBeMissing;
  public ReadOnlySpan<uint> UntrustedVerticesA { get { return Of(untrustedVerticesA); } }
  public ReadOnlySpan<uint> UntrustedVerticesB { get { return Of(untrustedVerticesB); } }
  public ReadOnlySpan<uint> DegenerateTrianglesA { get { return Of(degenerateTrianglesA); } }
  public ReadOnlySpan<uint> DegenerateTrianglesB { get { return Of(degenerateTrianglesB); } }
  public ReadOnlySpan<uint> OutsideBand { get { return Of(outsideBand); } }
  public ReadOnlySpan<uint> NearThreshold { get { return Of(nearThreshold); } }
  public ReadOnlySpan<uint> UnreliableSign { get { return Of(unreliableSign); } }
  public bool Trusted { get { return trusted != 0; } }
  public bool StartedApart { get { return startedApart != 0; } }
  public bool SideMayBeWrong { get { return sideMayBeWrong != 0; } }
  public bool Unwelded { get { return unwelded != 0; } }
  public bool AdvanceMayBeMissing { get { return advanceMayBeMissing != 0; } }
  static ReadOnlySpan<uint> Of(Indices list) { return Native.View<uint>(list.Data, list.Count); }
}
[Native("palpate_row")]
public struct Row {
  public Tetrahedron Vertices;
  public Weights4 Weights;
  public Vector Normal;
  public double Offset;
}
[Native("palpate_side")]
struct Side {
  public UIntPtr Size;
  public IntPtr Before, Now; public UIntPtr Count;
  public IntPtr Radii; public UIntPtr RadiusCount;
  public uint First;
  public Motion Motion;
}
[Native("palpate_surface_point")]
public struct SurfacePoint {
  public uint Geometry, Element;
  public Triangle Vertices;
  public Vector Weights, Position;
  public double Distance;
  public Vector Normal;
}
[Native("palpate_signed_distance")]
public struct SignedDistance {
  public SurfacePoint Nearest;
  public double Distance;
}
[Native("palpate_ray")]
public struct Ray {
  public Vector Origin, Direction;
  public double TMin, TMax;
  public Ray(Vector origin, Vector direction) {
    Origin = origin; Direction = direction; TMin = 0; TMax = double.PositiveInfinity;
  }
}
[Native("palpate_hit")]
public struct Hit {
  public uint Geometry, Element;
  public Triangle Vertices;
  public Vector Weights;
  public double T;
  byte frontFace, crosses;
  public bool FrontFace { get { return frontFace != 0; } }
  public bool Crosses { get { return crosses != 0; } }
}
[Native("palpate_distance")]
public struct GeometryDistance {
  public SurfacePoint A, B;
  public double Distance;
}
[Native("palpate_penetration")]
public struct Penetration {
  byte intersecting;
  public Vector Direction;
  public double Depth;
  public SurfacePoint A, B;
  byte minimal;
  public bool Intersecting { get { return intersecting != 0; } }
  public bool Minimal { get { return minimal != 0; } }
}
[Native("palpate_inside_settings")]
struct InsideSettings {
  public UIntPtr Size;
  public double Margin;
  public int Rule;
}

/// The contacts of a pair: spans of the library's memory, until the next call that changes the Detection.
public struct Contacts {
  ContactViews views;
  internal Contacts(ContactViews from) { views = from; }
  public ReadOnlySpan<VertexTriangle> VertexTriangle {
    get { return Native.View<VertexTriangle>(views.VertexTriangle, views.VertexTriangleCount); }
  }
  public ReadOnlySpan<VertexTriangle> TriangleVertex {
    get { return Native.View<VertexTriangle>(views.TriangleVertex, views.TriangleVertexCount); }
  }
  public ReadOnlySpan<EdgeEdge> EdgeEdge {
    get { return Native.View<EdgeEdge>(views.EdgeEdge, views.EdgeEdgeCount); }
  }
  public ReadOnlySpan<Pair> IntersectingTriangles {
    get { return Native.View<Pair>(views.IntersectingTriangles, views.IntersectingTriangleCount); }
  }
  public ReadOnlySpan<ShapeContact> Shape { get { return Native.View<ShapeContact>(views.Shape, views.ShapeCount); } }
  public ReadOnlySpan<ShapeShape> ShapeShape {
    get { return Native.View<ShapeShape>(views.ShapeShape, views.ShapeShapeCount); }
  }
  public double ErrorBound { get { return views.ErrorBound; } }
}

static unsafe class Native {
  const string Library = "Palpate";

  public static void Check(int status) {
    if (status != 0) throw new PalpateException(status, Marshal.PtrToStringAnsi(palpate_last_error()));
  }
  public static UIntPtr SizeOf<T>() { return (UIntPtr)Marshal.SizeOf(typeof(T)); }
  public static ReadOnlySpan<T> View<T>(IntPtr data, UIntPtr count) where T : struct {
    return new ReadOnlySpan<T>((void*)data, (int)count);
  }

  [DllImport(Library)] public static extern IntPtr palpate_last_error();
  [DllImport(Library)] public static extern int palpate_init_settings(out Settings settings, UIntPtr size);
  [DllImport(Library)] public static extern int palpate_init_pair_settings(out PairSettings settings, UIntPtr size);
  [DllImport(Library)] public static extern int palpate_init_filter(out Filter filter, UIntPtr size);
  [DllImport(Library)] public static extern int palpate_init_side(out Side side, UIntPtr size);
  [DllImport(Library)] public static extern int palpate_create(ref Settings settings, out IntPtr cd);
  [DllImport(Library)] public static extern void palpate_destroy(IntPtr cd);
  [DllImport(Library)] public static extern int palpate_add_triangle_mesh(IntPtr cd, Vector* positions, UIntPtr vertices, Triangle* triangles, UIntPtr count, out uint id);
  [DllImport(Library)] public static extern int palpate_add_tetrahedral_mesh(IntPtr cd, Vector* positions, UIntPtr vertices, Tetrahedron* tetrahedra, UIntPtr count, out uint id);
  [DllImport(Library)] public static extern int palpate_add_line_mesh(IntPtr cd, Vector* positions, UIntPtr vertices, Segment* segments, UIntPtr count, double* radii, UIntPtr radiusCount, out uint id);
  [DllImport(Library)] public static extern int palpate_add_point_set(IntPtr cd, Vector* positions, UIntPtr vertices, double* radii, UIntPtr radiusCount, out uint id);
  [DllImport(Library)] public static extern int palpate_add_shape(IntPtr cd, ref Shape shape, out uint id);
  [DllImport(Library)] public static extern int palpate_remove(IntPtr cd, uint id);
  [DllImport(Library)] public static extern int palpate_set_positions(IntPtr cd, uint id, Vector* now, UIntPtr count);
  [DllImport(Library)] public static extern int palpate_set_step(IntPtr cd, uint id, Vector* before, Vector* now, UIntPtr count);
  [DllImport(Library)] public static extern int palpate_set_some_positions(IntPtr cd, uint id, UIntPtr first, Vector* now, UIntPtr count);
  [DllImport(Library)] public static extern int palpate_set_triangles(IntPtr cd, uint id, Vector* positions, UIntPtr vertices, Triangle* triangles, UIntPtr count);
  [DllImport(Library)] public static extern int palpate_set_transform(IntPtr cd, uint id, ref Pose now);
  [DllImport(Library)] public static extern int palpate_set_motion(IntPtr cd, uint id, ref Motion motion);
  [DllImport(Library)] public static extern int palpate_set_filter(IntPtr cd, uint id, ref Filter filter);
  [DllImport(Library)] public static extern int palpate_set_disabled_elements(IntPtr cd, uint id, uint* elements, UIntPtr count);
  [DllImport(Library)] public static extern int palpate_get_positions(IntPtr cd, uint id, out IntPtr positions, out UIntPtr count);
  [DllImport(Library)] public static extern int palpate_add_pair(IntPtr cd, uint a, uint b, ref PairSettings settings);
  [DllImport(Library)] public static extern int palpate_set_pair_settings(IntPtr cd, uint a, uint b, ref PairSettings settings);
  [DllImport(Library)] public static extern int palpate_remove_pair(IntPtr cd, uint a, uint b);
  [DllImport(Library)] public static extern int palpate_detect(IntPtr cd);
  [DllImport(Library)] public static extern int palpate_detect_within(IntPtr cd, long microseconds, out byte complete);
  [DllImport(Library)] public static extern int palpate_cancel_detection(IntPtr cd);
  [DllImport(Library)] public static extern int palpate_advance(IntPtr cd);
  [DllImport(Library)] public static extern int palpate_get_contacts(IntPtr cd, uint a, uint b, ref ContactViews contacts);
  [DllImport(Library)] public static extern int palpate_get_validity(IntPtr cd, uint a, uint b, ref Validity validity);
  [DllImport(Library)] public static extern int palpate_get_hash(IntPtr cd, uint a, uint b, out ulong hash);
  [DllImport(Library)] public static extern int palpate_get_rows(IntPtr cd, uint a, uint b, ref Side sideA, ref Side sideB, Motion* body, Row* rows, UIntPtr capacity, out UIntPtr count);
  [DllImport(Library)] public static extern int palpate_create_queries(IntPtr cd, out IntPtr queries);
  [DllImport(Library)] public static extern void palpate_destroy_queries(IntPtr queries);
  [DllImport(Library)] public static extern int palpate_closest_points(IntPtr queries, uint id, Vector* points, UIntPtr count, double maxDistance, SurfacePoint* result);
  [DllImport(Library)] public static extern int palpate_contains(IntPtr queries, uint body, Vector* points, UIntPtr count, InsideSettings* settings, byte* inside);
  [DllImport(Library)] public static extern int palpate_signed_distances(IntPtr queries, uint body, Vector* points, UIntPtr count, InsideSettings* settings, SignedDistance* result);
  [DllImport(Library)] public static extern int palpate_first_hits(IntPtr queries, uint id, Ray* rays, UIntPtr count, Hit* result);
  [DllImport(Library)] public static extern int palpate_get_distance(IntPtr queries, uint a, uint b, out GeometryDistance distance);
  [DllImport(Library)] public static extern int palpate_get_penetration(IntPtr queries, uint a, uint b, out Penetration penetration);
}

/// Collision detection. Call SetPositions(), Detect(), Contacts() and Advance() in each step. Arrays of numbers are x, y,
/// z of each position.
public sealed unsafe class Detection : IDisposable {
  IntPtr cd;

  public Detection() : this(Settings.Default) {}
  public Detection(Settings settings) { Native.Check(Native.palpate_create(ref settings, out cd)); }
  public void Dispose() { Native.palpate_destroy(cd); cd = IntPtr.Zero; GC.SuppressFinalize(this); }
  ~Detection() { Native.palpate_destroy(cd); }

  public uint AddTriangleMesh(ReadOnlySpan<Vector> positions, ReadOnlySpan<Triangle> triangles) {
    uint id;
    fixed (Vector* p = &At(positions)) fixed (Triangle* t = &At(triangles))
      Native.Check(Native.palpate_add_triangle_mesh(cd, p, N(positions.Length), t, N(triangles.Length), out id));
    return id;
  }
  public uint AddTetrahedralMesh(ReadOnlySpan<Vector> positions, ReadOnlySpan<Tetrahedron> tetrahedra) {
    uint id;
    fixed (Vector* p = &At(positions)) fixed (Tetrahedron* t = &At(tetrahedra))
      Native.Check(Native.palpate_add_tetrahedral_mesh(cd, p, N(positions.Length), t, N(tetrahedra.Length), out id));
    return id;
  }
  /// radii: none, one for all vertices, or one per vertex.
  public uint AddLineMesh(ReadOnlySpan<Vector> positions, ReadOnlySpan<Segment> segments, ReadOnlySpan<double> radii) {
    uint id;
    fixed (Vector* p = &At(positions)) fixed (Segment* s = &At(segments)) fixed (double* r = &At(radii))
      Native.Check(Native.palpate_add_line_mesh(cd, p, N(positions.Length), s, N(segments.Length), r, N(radii.Length), out id));
    return id;
  }
  public uint AddPointSet(ReadOnlySpan<Vector> positions, ReadOnlySpan<double> radii) {
    uint id;
    fixed (Vector* p = &At(positions)) fixed (double* r = &At(radii))
      Native.Check(Native.palpate_add_point_set(cd, p, N(positions.Length), r, N(radii.Length), out id));
    return id;
  }
  public uint AddShape(Shape shape) { return AddShape(shape, ReadOnlySpan<Vector>.Empty); }
  /// points: of a hull.
  public uint AddShape(Shape shape, ReadOnlySpan<Vector> points) {
    uint id;
    fixed (Vector* p = &At(points)) {
      shape.Size = Native.SizeOf<Shape>();
      shape.Points = (IntPtr)p;
      shape.PointCount = N(points.Length);
      Native.Check(Native.palpate_add_shape(cd, ref shape, out id));
    }
    return id;
  }
  public void Remove(uint id) { Native.Check(Native.palpate_remove(cd, id)); }

  public void SetPositions(uint id, ReadOnlySpan<Vector> now) {
    fixed (Vector* n = &At(now)) Native.Check(Native.palpate_set_positions(cd, id, n, N(now.Length)));
  }
  public void SetPositions(uint id, ReadOnlySpan<Vector> before, ReadOnlySpan<Vector> now) {
    if (before.Length != now.Length) throw new ArgumentException("before and now differ in length");
    fixed (Vector* b = &At(before)) fixed (Vector* n = &At(now))
      Native.Check(Native.palpate_set_step(cd, id, b, n, N(now.Length)));
  }
  public void SetPositions(uint id, int first, ReadOnlySpan<Vector> now) {
    fixed (Vector* n = &At(now))
      Native.Check(Native.palpate_set_some_positions(cd, id, N(first), n, N(now.Length)));
  }
  public void SetTriangles(uint id, ReadOnlySpan<Vector> positions, ReadOnlySpan<Triangle> triangles) {
    fixed (Vector* p = &At(positions)) fixed (Triangle* t = &At(triangles))
      Native.Check(Native.palpate_set_triangles(cd, id, p, N(positions.Length), t, N(triangles.Length)));
  }
  public void SetTransform(uint id, Pose now) { Native.Check(Native.palpate_set_transform(cd, id, ref now)); }
  public void SetMotion(uint id, Motion motion) { Native.Check(Native.palpate_set_motion(cd, id, ref motion)); }
  public void SetFilter(uint id, Filter filter) { Native.Check(Native.palpate_set_filter(cd, id, ref filter)); }
  public void SetDisabledElements(uint id, ReadOnlySpan<uint> elements) {
    fixed (uint* e = &At(elements))
      Native.Check(Native.palpate_set_disabled_elements(cd, id, e, N(elements.Length)));
  }
  /// A view, as Contacts.
  public ReadOnlySpan<Vector> Positions(uint id) {
    IntPtr positions;
    UIntPtr count;
    Native.Check(Native.palpate_get_positions(cd, id, out positions, out count));
    return Native.View<Vector>(positions, count);
  }

  public void AddPair(uint a, uint b) { AddPair(a, b, PairSettings.Default); }
  public void AddPair(uint a, uint b, PairSettings settings) {
    Native.Check(Native.palpate_add_pair(cd, a, b, ref settings));
  }
  public void SetPairSettings(uint a, uint b, PairSettings settings) {
    Native.Check(Native.palpate_set_pair_settings(cd, a, b, ref settings));
  }
  public void RemovePair(uint a, uint b) { Native.Check(Native.palpate_remove_pair(cd, a, b)); }

  public void Detect() { Native.Check(Native.palpate_detect(cd)); }
  /// Returns whether everything was finished.
  public bool Detect(long microseconds) {
    byte complete;
    Native.Check(Native.palpate_detect_within(cd, microseconds, out complete));
    return complete != 0;
  }
  public void CancelDetection() { Native.Check(Native.palpate_cancel_detection(cd)); }
  public void Advance() { Native.Check(Native.palpate_advance(cd)); }
  public Contacts Contacts(uint a, uint b) {
    var views = new ContactViews { Size = Native.SizeOf<ContactViews>() };
    Native.Check(Native.palpate_get_contacts(cd, a, b, ref views));
    return new Contacts(views);
  }
  public Validity Validity(uint a, uint b) {
    var validity = new Validity { Size = Native.SizeOf<Validity>() };
    Native.Check(Native.palpate_get_validity(cd, a, b, ref validity));
    return validity;
  }
  public ulong Hash(uint a, uint b) {
    ulong hash;
    Native.Check(Native.palpate_get_hash(cd, a, b, out hash));
    return hash;
  }
  /// Constraint rows of two meshes, of which the vertices have the numbers firstA and firstB onward in your solver. Empty
  /// positions: a shape, which rests.
  public Row[] Rows(uint a, uint b, ReadOnlySpan<Vector> beforeA, ReadOnlySpan<Vector> nowA, uint firstA,
                    ReadOnlySpan<Vector> beforeB, ReadOnlySpan<Vector> nowB, uint firstB) {
    if (beforeA.Length != nowA.Length || beforeB.Length != nowB.Length)
      throw new ArgumentException("before and now differ in length");
    fixed (Vector* ba = &At(beforeA)) fixed (Vector* na = &At(nowA))
    fixed (Vector* bb = &At(beforeB)) fixed (Vector* nb = &At(nowB)) {
      Side sideA, sideB;
      Native.Check(Native.palpate_init_side(out sideA, Native.SizeOf<Side>()));
      sideB = sideA;
      sideA.Before = (IntPtr)ba; sideA.Now = (IntPtr)na; sideA.Count = N(nowA.Length); sideA.First = firstA;
      sideB.Before = (IntPtr)bb; sideB.Now = (IntPtr)nb; sideB.Count = N(nowB.Length); sideB.First = firstB;
      UIntPtr count;
      Native.Check(Native.palpate_get_rows(cd, a, b, ref sideA, ref sideB, null, null, UIntPtr.Zero, out count));
      var rows = new Row[(int)count];
      fixed (Row* r = rows)
        Native.Check(Native.palpate_get_rows(cd, a, b, ref sideA, ref sideB, null, r, count, out count));
      return rows;
    }
  }

  public Queries CreateQueries() { return new Queries(cd); }

  static UIntPtr N(int count) { return (UIntPtr)(uint)count; }
  internal static ref T At<T>(ReadOnlySpan<T> span) where T : struct {
    return ref MemoryMarshal.GetReference(span);
  }
}

/// Queries at the positions now. Calls throw after these change; create it again then.
public sealed unsafe class Queries : IDisposable {
  IntPtr queries;

  internal Queries(IntPtr cd) { Native.Check(Native.palpate_create_queries(cd, out queries)); }
  public void Dispose() { Native.palpate_destroy_queries(queries); queries = IntPtr.Zero; GC.SuppressFinalize(this); }
  ~Queries() { Native.palpate_destroy_queries(queries); }

  public void ClosestPoints(uint id, ReadOnlySpan<Vector> points, Span<SurfacePoint> result, double maxDistance) {
    Same(points.Length, result.Length);
    fixed (Vector* p = &Detection.At(points)) fixed (SurfacePoint* r = &MemoryMarshal.GetReference(result))
      Native.Check(Native.palpate_closest_points(queries, id, p, (UIntPtr)(uint)points.Length, maxDistance, r));
  }
  public void SignedDistances(uint body, ReadOnlySpan<Vector> points, Span<SignedDistance> result) {
    Same(points.Length, result.Length);
    fixed (Vector* p = &Detection.At(points)) fixed (SignedDistance* r = &MemoryMarshal.GetReference(result))
      Native.Check(Native.palpate_signed_distances(queries, body, p, (UIntPtr)(uint)points.Length, null, r));
  }
  public bool Contains(uint body, Vector point) {
    byte inside;
    Native.Check(Native.palpate_contains(queries, body, &point, (UIntPtr)1, null, &inside));
    return inside != 0;
  }
  public void FirstHits(uint id, ReadOnlySpan<Ray> rays, Span<Hit> result) {
    Same(rays.Length, result.Length);
    fixed (Ray* p = &Detection.At(rays)) fixed (Hit* r = &MemoryMarshal.GetReference(result))
      Native.Check(Native.palpate_first_hits(queries, id, p, (UIntPtr)(uint)rays.Length, r));
  }
  public GeometryDistance Distance(uint a, uint b) {
    GeometryDistance distance;
    Native.Check(Native.palpate_get_distance(queries, a, b, out distance));
    return distance;
  }
  public Penetration Penetration(uint a, uint b) {
    Penetration penetration;
    Native.Check(Native.palpate_get_penetration(queries, a, b, out penetration));
    return penetration;
  }
  static void Same(int points, int results) {
    if (points != results) throw new ArgumentException("points and results differ in length");
  }
}

}
