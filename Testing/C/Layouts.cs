// Prints the size of each struct of Palpate.cs, sorted, and checks each kind of call of the classes.
using System;
using System.Collections.Generic;
using System.Runtime.InteropServices;
using Palpate;

static class Layouts {
  static void Expect(bool holds, string what) {
    if (!holds) throw new Exception(what);
  }

  static void Main() {
    var lines = new List<string>();
    foreach (Type type in typeof(Detection).Assembly.GetTypes())
      foreach (NativeAttribute native in type.GetCustomAttributes(typeof(NativeAttribute), false))
        lines.Add(native.Name + " " + Marshal.SizeOf(type));
    lines.Sort(string.CompareOrdinal);
    foreach (string line in lines) Console.WriteLine(line);

    Vector[] positions = {new Vector(0, 0, 0), new Vector(1, 0, 0), new Vector(0, 1, 0), new Vector(0, 0, 1)};
    Triangle[] triangles = {new Triangle(0, 2, 1), new Triangle(0, 1, 3), new Triangle(0, 3, 2), new Triangle(1, 2, 3)};
    Settings settings = Settings.Default;
    settings.Threads = 1;
    using (var detection = new Detection(settings)) {
      uint mesh = detection.AddTriangleMesh(positions, triangles);
      uint solid = detection.AddTetrahedralMesh(positions, new[] {new Tetrahedron(0, 1, 2, 3)});
      uint thread = detection.AddLineMesh(positions, new[] {new Segment(0, 1)}, new[] {0.1});
      uint drops = detection.AddPointSet(positions, ReadOnlySpan<double>.Empty);
      uint ball = detection.AddShape(new Shape {Kind = ShapeKind.Sphere, Radius = 0.5});
      uint hull = detection.AddShape(new Shape {Kind = ShapeKind.Hull}, positions);
      PairSettings pair = PairSettings.Default;
      pair.Thickness = 0.1;
      detection.AddPair(mesh, thread, pair);
      detection.AddPair(mesh, ball, pair);
      detection.AddPair(mesh, solid, pair);
      detection.AddPair(mesh, drops, pair);
      Pose pose = Pose.Identity;
      pose.Translation = new Vector(0.3, 0.3, 0.3);
      detection.SetTransform(ball, pose);
      detection.SetPositions(mesh, positions, positions);
      detection.SetPositions(mesh, 1, new[] {new Vector(1, 0.1, 0)});
      Expect(detection.Positions(mesh)[1].Y == 0.1, "positions");
      Filter filter = Filter.Default;
      filter.Groups = 3;
      detection.SetFilter(mesh, filter);
      detection.SetDisabledElements(solid, new uint[] {0});
      detection.Detect();
      Expect(detection.Contacts(mesh, ball).Shape.Length > 0, "contacts with a ball");
      Expect(detection.Contacts(mesh, thread).VertexTriangle.Length + detection.Contacts(mesh, thread).TriangleVertex.Length > 0,
             "contacts with a thread");
      Expect(detection.Validity(mesh, thread).Method != Method.Auto, "validity");
      Row[] rows = detection.Rows(mesh, ball, positions, positions, 10, ReadOnlySpan<Vector>.Empty,
                                  ReadOnlySpan<Vector>.Empty, 0);
      Expect(rows.Length == detection.Contacts(mesh, ball).Shape.Length && rows[0].Vertices.A >= 10, "rows");
      Expect(detection.Hash(mesh, ball) != 0, "hash");
      using (Queries queries = detection.CreateQueries()) {
        Expect(queries.Contains(mesh, new Vector(0.2, 0.2, 0.2)), "contains");
        var hits = new Hit[1];
        queries.FirstHits(mesh, new[] {new Ray(new Vector(0.2, 0.2, 5), new Vector(0, 0, -1))}, hits);
        Expect(hits[0].T > 4 && hits[0].T < 5 && hits[0].FrontFace, "hit");
        var nearest = new SurfacePoint[1];
        queries.ClosestPoints(mesh, new[] {new Vector(0.1, 0.1, -3)}, nearest, double.PositiveInfinity);
        Expect(nearest[0].Distance == 3, "closest point");
        var distances = new SignedDistance[1];
        queries.SignedDistances(mesh, new[] {new Vector(0.1, 0.1, 0.1)}, distances);
        Expect(distances[0].Distance < 0, "signed distance");
        Expect(queries.Distance(mesh, ball).Distance == 0, "distance");
        Expect(queries.Penetration(hull, ball).Intersecting, "penetration");
      }
      try {
        detection.Remove(99);
        Expect(false, "no exception");
      } catch (PalpateException error) {
        Expect(error.Status == 4 && error.Message.Contains("99"), error.Message);
      }
    }
  }
}
