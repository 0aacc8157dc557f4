// From two meshes to their contacts: a needle's tip comes down on a piece of tissue.
using System;
using System.Globalization;
using Palpate;

static class HelloCollision {
  static void Main() {
    Vector[] tissue = {new Vector(-1, -1, 0), new Vector(1, -1, 0), new Vector(1, 1, 0), new Vector(-1, 1, 0)};
    Triangle[] tissueTriangles = {new Triangle(0, 1, 2), new Triangle(0, 2, 3)};
    Vector[] tip = {new Vector(0.2, 0, 1), new Vector(0.4, 0, 1), new Vector(0.3, 0.2, 1), new Vector(0.3, 0.1, 0.41)};
    Triangle[] tipTriangles = {new Triangle(0, 1, 3), new Triangle(1, 2, 3), new Triangle(2, 0, 3), new Triangle(0, 2, 1)};

    using (var detection = new Detection()) {
      uint tool = detection.AddTriangleMesh(tip, tipTriangles);
      uint organ = detection.AddTriangleMesh(tissue, tissueTriangles);
      PairSettings settings = PairSettings.Default;
      settings.Method = Method.Proximity;
      settings.Thickness = 0.02;
      detection.AddPair(tool, organ, settings);

      for (int frame = 0; frame < 5; ++frame) {
        detection.SetPositions(tool, tip);
        detection.Detect();
        ReadOnlySpan<VertexTriangle> contacts = detection.Contacts(tool, organ).VertexTriangle;
        if (contacts.IsEmpty) Console.WriteLine("frame {0}: no contact", frame);
        foreach (VertexTriangle contact in contacts) {
          string negative = double.IsNegativeInfinity(1 / contact.Normal.X) ? "-" : "";  // Mono prints -0 as 0
          Console.WriteLine(string.Format(CultureInfo.InvariantCulture,
            "frame {0}: vertex {1} of the tip touches triangle {2} of the tissue, {3:F3} away, normal ({4}{5}, {6}, {7})",
            frame, contact.Vertex, contact.TriangleId, contact.Distance, negative, contact.Normal.X, contact.Normal.Y,
            contact.Normal.Z));
        }
        detection.Advance();
        for (int vertex = 0; vertex < tip.Length; ++vertex) tip[vertex].Z -= 0.1;
      }
    }
  }
}
