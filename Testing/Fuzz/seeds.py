#!/usr/bin/env python3
"""seeds.py FOLDER: writes the seeds of Data/Fuzz, one folder for each target of Targets.h.

Small valid files of every kind that a reader accepts, files that once took much memory or time, and
random decisions. Findings that the fuzzer kept are not made here.
"""
import base64
import lzma
import random
import struct
import sys
import zlib
from pathlib import Path

TEN = 10_000  # bytes of a file that repeats itself


def repeated(text, size=TEN):
    return text * (size // len(text) + 1)


def obj():
    yield "quad", "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvn 0 0 1\nf 1//1 2//1 3//1 4//1\n"
    yield "relative", "# x\nv 0 0 0\r\nv 1e-3 +0 0\r\nv 1 1 .5\r\nvt 0 0\r\nf -3/1/1 -2/1/1 \\\n -1/1/1\r\n"
    yield "corners", "v 0 0 0\n" + repeated("f 1 1 1\n")
    yield "lines", "v 0 0 0\nv 1 0 0\nv 0 1 0\nl 1 2 -1\np 3 1\n"
    yield "continued", "v 0 0 0\nf 1 1 " + repeated("1\\\n ")


def stl():
    facet = "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex {} 1 0\nendloop\nendfacet\n"
    yield "text", "solid x\n" + facet.format(0) + facet.format(1) + "endsolid x\n"
    triangle = struct.pack("<12fH", 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0)
    yield "binary", bytes(80) + struct.pack("<I", 2) + triangle * 2
    yield "many", bytes(80) + struct.pack("<I", 4_000_000_000) + triangle


def ply():
    head = "ply\nformat {} 1.0\nelement vertex 3\nproperty float x\nproperty double y\nproperty uchar z\n" \
           "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
    yield "ascii", head.format("ascii") + "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"
    for name, order in (("little", "<"), ("big", ">")):
        points = b"".join(struct.pack(order + "fdB", *p) for p in ((0, 0, 0), (1, 0, 0), (0, 1, 1)))
        yield name, head.format(f"binary_{name}_endian").encode() + points + struct.pack(order + "B3i", 3, 0, 1, 2)
    start = "ply\nformat binary_little_endian 1.0\n"
    xyz = "property uchar x\nproperty uchar y\nproperty uchar z\n"
    yield "strips", start + "element vertex 4\n" + xyz + "element tristrips 1\nproperty list int int vertex_indices\nend_header\n" \
        + bytes(range(12)).decode() + struct.pack("<6i", 5, 0, 1, 2, -1, 3).decode("latin1")
    yield "edges", head.format("ascii").replace("end_header", "element edge 1\nproperty int vertex1\nproperty int vertex2\nend_header") \
        + "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n0 2\n"
    yield "no-properties", start + repeated("element vertex 100\n") + "end_header\n"
    yield "properties", start + "element x 0\n" + repeated("property char a\n") + "end_header\n"
    yield "short", start + "element vertex 4000000000\n" + xyz + "end_header\n" + "x" * 20


def vtk():
    head = "# vtk DataFile Version {}\nx\n{}\nDATASET POLYDATA\n"
    points = "POINTS 4 double\n0 0 0 1 0 0 1 1 0 0 1 0\n"
    yield "ascii", head.format("3.0", "ASCII") + points + "POLYGONS 1 5\n4 0 1 2 3\nTRIANGLE_STRIPS 1 5\n4 0 1 3 2\n"
    yield "binary", (head.format("3.0", "BINARY") + "POINTS 3 float\n").encode() + struct.pack(">9f", 0, 0, 0, 1, 0, 0, 0, 1, 0) \
        + b"\nPOLYGONS 1 4\n" + struct.pack(">4i", 3, 0, 1, 2)
    yield "offsets", head.format("5.1", "ASCII") + points \
        + "POLYGONS 2 4\nOFFSETS vtktypeint64\n0 4\nCONNECTIVITY vtktypeint64\n0 1 2 3\n"
    grid = head.replace("POLYDATA", "UNSTRUCTURED_GRID").format("3.0", "ASCII") + points
    yield "grid", grid + "CELLS 3 11\n1 3\n3 0 1 2\n4 0 1 2 3\nCELL_TYPES 3\n1\n5\n10\n"
    yield "grid-offsets", grid.replace("3.0", "5.1") + "CELLS 2 4\nOFFSETS vtktypeint64\n0 4\nCONNECTIVITY vtktypeint64\n0 1 2 3\n" \
        "CELL_TYPES 1\n10\n"
    yield "long-name", "# vtk DataFile Version 3.0\nx\nASCII\nDATASET " + "x" * TEN


def vtp():
    def file(pieces, attributes="", appended=""):
        return f'<VTKFile type="PolyData" byte_order="LittleEndian"{attributes}><PolyData>{pieces}</PolyData>{appended}</VTKFile>'

    def array(name, kind, form, text="", offset=None):
        at = "" if offset is None else f' offset="{offset}"'
        return f'<DataArray type="{kind}" Name="{name}" format="{form}"{at}>{text}</DataArray>'

    def piece(points, connectivity, offsets, count=3):
        return f'<Piece NumberOfPoints="{count}" NumberOfPolys="1"><Points>{points}</Points><Polys>{connectivity}{offsets}</Polys></Piece>'

    cells = array("connectivity", "Int32", "ascii", "0 1 2"), array("offsets", "Int32", "ascii", "3")
    coordinates = struct.pack("<9f", 0, 0, 0, 1, 0, 0, 0, 1, 0)
    yield "ascii", file(piece(array("Points", "Float32", "ascii", "0 0 0 1 0 0 0 1 0"), *cells))
    block = struct.pack("<I", 36) + coordinates
    yield "base64", file(piece(array("Points", "Float32", "binary", base64.b64encode(block).decode()), *cells))
    appended = piece(array("Points", "Float32", "appended", "", 0), *cells)
    raw = '<AppendedData encoding="raw">_{}</AppendedData>'
    yield "raw", file(appended, "", raw.format(block.decode("latin1")))
    lz4 = bytes([0xF0, 36 - 15]) + coordinates  # literals only
    for name, packed in (("ZLib", zlib.compress(coordinates)), ("LZMA", lzma.compress(coordinates)), ("LZ4", lz4)):
        block = struct.pack("<4I", 1, 36, 0, len(packed)) + packed
        yield name.lower(), file(appended, f' compressor="vtk{name}DataCompressor"', raw.format(block.decode("latin1")))
    packed = zlib.compress(bytes(300))
    block = struct.pack("<4I", 1, 300, 0, len(packed)) + packed
    share = piece(array("Points", "UInt8", "appended", "", 0), *cells, count=100)
    yield "shared-block", file(share * 12, ' compressor="vtkZLibDataCompressor"', raw.format(block.decode("latin1")))
    yield "pieces", file(repeated("<Piece ") + "</Piece>")


def vtu():
    def array(name, kind, form, text="", offset=None):
        at = "" if offset is None else f' offset="{offset}"'
        return f'<DataArray type="{kind}" Name="{name}" format="{form}"{at}>{text}</DataArray>'

    def file(points, corners, ends, types, attributes="", appended=""):
        return f'<VTKFile type="UnstructuredGrid" byte_order="LittleEndian"{attributes}><UnstructuredGrid>' \
               f'<Piece NumberOfPoints="4" NumberOfCells="2"><Points>{points}</Points><Cells>{corners}{ends}{types}</Cells></Piece>' \
               f'</UnstructuredGrid>{appended}</VTKFile>'

    points = array("Points", "Float64", "ascii", "0 0 0 1 0 0 0 1 0 0 0 1")
    corners = array("connectivity", "Int64", "ascii", "0 1 2 0 1 2 3")
    yield "ascii", file(points, corners, array("offsets", "Int64", "ascii", "3 7"), array("types", "UInt8", "ascii", "5 10"))
    ends, types = struct.pack("<I2q", 16, 3, 7), struct.pack("<I2B", 2, 5, 10)
    inline = [array(name, kind, "binary", base64.b64encode(block).decode())
              for name, kind, block in (("offsets", "Int64", ends), ("types", "UInt8", types))]
    yield "base64", file(points, corners, *inline)
    raw = f'<AppendedData encoding="raw">_{(ends + types).decode("latin1")}</AppendedData>'
    yield "raw", file(points, corners, array("offsets", "Int64", "appended", "", 0), array("types", "UInt8", "appended", "", 20), "", raw)
    packed = zlib.compress(struct.pack("<2q", 3, 7), 9)
    block = struct.pack("<4I", 1, 16, 0, len(packed)) + packed
    raw = f'<AppendedData encoding="raw">_{block.decode("latin1")}</AppendedData>'
    yield "zlib", file(points, corners, array("offsets", "Int64", "appended", "", 0), array("types", "UInt8", "ascii", "5 10"),
                       ' compressor="vtkZLibDataCompressor"', raw)


def gmsh():
    head = "$MeshFormat\n{} {} 8\n{}$EndMeshFormat\n"
    yield "old", head.format("2.2", 0, "") + "$Nodes\n4\n1 0 0 0\n2 1 0 0\n3 0 1 0\n9 0 0 1\n$EndNodes\n" \
        "$Elements\n3\n1 15 2 0 1 9\n2 3 2 0 1 1 2 3 9\n3 4 0 1 2 3 9\n$EndElements\n"
    yield "new", head.format("4.1", 0, "") + "$Nodes\n2 4 1 4\n0 1 0 1\n1\n0 0 0\n2 1 1 3\n2\n3\n4\n" \
        "1 0 0 0 1\n0 1 0 1 0\n0 0 1 1 1\n$EndNodes\n$Elements\n2 2 1 2\n1 1 1 1\n1 1 2\n3 1 4 1\n2 1 2 3 4\n$EndElements\n"
    for name, order in (("little", "<"), ("big", ">")):
        one = (struct.pack(order + "i", 1) + b"\n").decode("latin1")
        nodes = b"".join(struct.pack(order + "i3d", *node) for node in ((1, 0, 0, 0), (2, 1, 0, 0), (3, 0, 1, 0), (4, 0, 0, 1)))
        elements = struct.pack(order + "16i", 2, 1, 1, 1, 0, 1, 2, 3, 4, 1, 1, 2, 1, 2, 3, 4)
        yield f"old-{name}", head.format("2.2", 1, one) + "$Nodes\n4\n" + nodes.decode("latin1") + "\n$EndNodes\n$Elements\n2\n" \
            + elements.decode("latin1") + "\n$EndElements\n"
        nodes = struct.pack(order + "4Q3iQ4Q12d", 1, 4, 1, 4, 3, 1, 0, 4, 1, 2, 3, 4, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1)
        elements = struct.pack(order + "4Q3iQ5Q", 1, 1, 1, 1, 3, 1, 4, 1, 1, 1, 2, 3, 4)
        yield f"new-{name}", head.format("4.1", 1, one) + "$Nodes\n" + nodes.decode("latin1") + "\n$EndNodes\n$Elements\n" \
            + elements.decode("latin1") + "\n$EndElements\n"
    yield "sections", head.format("4.1", 0, "") + repeated("$a\n$Enda\n")


def medit():
    head = "MeshVersionFormatted 2\nDimension 3\n"
    yield "all", head + "Vertices 4\n0 0 0 1\n1 0 0 1\n0 1 0 1\n0 0 1 1 # last\nEdges 1 1 2 0\nTriangles 1\n1 2 3 0\n" \
        "Quadrilaterals 1\n1 2 3 4 0\nTetrahedra 1\n1 2 3 4 5\nCorners 1 1\nNormals 1\n0 0 1\nNormalAtVertices 1\n1 1\n" \
        "AngleOfCornerBound 40\nHexahedra 0\nEnd\n"
    yield "comments", head + repeated("# a\n") + "Vertices 1 0 0 0 0 Tetrahedra 1 1 1 1 1 1 End"
    yield "early", head + "Triangles 1\n1 2 3 0\nVertices 3\n0 0 0 0\n1 0 0 0\n0 1 0 0\nEnd\n"


def capture():
    for path in sorted(Path(__file__).parents[2].glob("Data/Regression/*.capture")):
        yield path.stem, path.read_bytes()
    for name, shape in (("sphere", "Sphere 0p+0 0p+0 0p+0 1p+0"), ("plane", "Plane 0p+0 0p+0 0p+0 0p+0 0p+0 1p+0"),
                        ("hull", "ConvexHull 4 0p+0 0p+0 0p+0 1p+0 0p+0 0p+0 0p+0 1p+0 0p+0 0p+0 0p+0 1p+0")):
        pose = "1p+0 0p+0 0p+0 0p+0 0p+0 1p+0 0p+0 0p+0 0p+0 0p+0 1p+0 0p+0 "
        yield name, f"palpate-capture 11\nOctree 1 32 32 Auto Box\n1 0\ngeometry 0 0 0 Shape 0 {shape} {pose}{pose}" \
                    "1 4294967295 Both 0 0 0\nend\n"
    yield "geometries", "palpate-capture 11\nOctree 1 32 32 Auto Box\n666 0\n" + repeated("geometry 0 0 0 ") + "\n"
    yield "many-points", "palpate-capture 11\nOctree 1 32 32 Auto Box\n666 0\n" \
        + repeated("geometry 0 0 0 Points 0 1 1 Both 0 0 0\n") + "end\n"
    yield "long-word", "palpate-capture 11\n" + "x" * TEN


def field():
    def file(roots, blocks, leaves, exponent=0, band=1.0, size=(1, 1, 1), origin=(0, 0, 0), is_open=0):
        data = b"palpate-field\0\0\0" + struct.pack("<Iidd3q3IIdQQ", 2, exponent, 0.1, band, *origin, *size, is_open, 0.5 * is_open,
                                                    len(blocks), len(leaves))
        data += b"".join(struct.pack("<I", entry) for entry in roots)
        data += b"".join(struct.pack("<8I", *block) for block in blocks) + b"".join(struct.pack("<8f", *leaf) for leaf in leaves)
        total = 0xcbf29ce484222325
        for byte in data:
            total = (total ^ byte) * 0x100000001b3 % 2**64
        return data + struct.pack("<Q", total)

    leaf, outside, inside = 1 << 30, 2 << 30, 3 << 30
    values = (-0.5, 0.5, -0.5, 0.5, -0.25, 0.25, -1, 1)
    yield "leaf", file([leaf], [], [values])
    yield "grid", file([leaf, outside, inside, leaf + 1], [], [values, values], -3, 0.25, (2, 2, 1), (-5, 7, 2**40))
    yield "block", file([0], [(leaf, outside, inside, leaf + 1, 1, leaf, leaf, leaf), (leaf,) * 8], [values, values])
    unsigned = leaf | 1 << 29
    yield "open", file([leaf, outside, inside, unsigned + 1], [], [values, (0.5,) * 8], -3, 0.25, (2, 2, 1), is_open=1)
    yield "deep", file([0], [(block + 1,) * 8 for block in range(39)] + [(leaf,) * 8], [values])
    yield "wide-band", file([outside], [], [values], -1000, 1e300)
    yield "far", file([leaf], [], [values], 1000, 1e300)


def decisions(sizes, count):
    def seeds():
        generator = random.Random(count)
        for i in range(count):
            yield f"random{i}", generator.randbytes(generator.randint(*sizes))
    return seeds


def main():
    if len(sys.argv) != 2 or sys.argv[1].startswith("-"):
        sys.exit(__doc__)
    targets = {"Obj": obj, "Stl": stl, "Ply": ply, "Vtk": vtk, "Vtp": vtp, "Vtu": vtu, "Gmsh": gmsh, "Medit": medit,
               "Capture": capture, "Field": field,
               "Distance": decisions((100, 114), 8), "Intersection": decisions((150, 169), 8),
               "TimeOfImpact": decisions((200, 227), 8), "History": decisions((200, 900), 12)}
    for name, seeds in targets.items():
        folder = Path(sys.argv[1]) / name
        folder.mkdir(parents=True, exist_ok=True)
        for seed, content in seeds():
            data = content if isinstance(content, bytes) else content.encode("latin1")
            (folder / f"seed-{seed}").write_bytes(data)


main()
