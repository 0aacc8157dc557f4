"""Everything in the public headers has a name in Python. Exceptions are listed with reasons."""

import enum
import os
import pathlib
import re

import numpy as np
import pytest

import palpate

SOURCE = pathlib.Path(os.environ["PALPATE_SOURCE"]) / "Source"
HEADERS = sorted((SOURCE / "Public" / "palpate").glob("[A-Z]*.h")) + [  # not the C header
    SOURCE / "Simplify" / "Public" / "palpate" / "Simplify.h",
    SOURCE / "Adapters" / "MeshFiles" / "Public" / "palpate" / "MeshFiles.h",
]

# C++ name: the reason why Python has no such name, or where Python has it.
FUNCTIONS = {
    "toString": "enumerators have a name",
    "positionsOf": "NumPy arrays go in as they are",
    "copyPositions": "NumPy converts",
    "elementsOf": "NumPy arrays go in as they are",
    "appendCells": "fills structs of a C++ simulator",
    "stencil": "CollisionData.stencils()",
    "appendRows": "CollisionData.constraint_rows() and rows()",
    "forEachEntry": "CollisionData.rows()",
    "appendTriplets": "CollisionData.rows()",
    "appendMotions": "CollisionData.motions()",
}
METHODS = {
    "CollisionData.appendRows": "CollisionData.constraint_rows() and rows() without a and b",
    "CollisionData.parts": "the properties of CollisionData",
    "CollisionData.tagsOf": "rows of CollisionData.tags()",
    "Executor.run": "a Python executor would run all tasks under the GIL",
    "ConstraintRow.gap": "jacobian @ x - offsets",
}
# Structs that are no class in Python.
CLASSES = {
    "ElementPair": "(n, 2) arrays, or records",
    "CollisionData.Parts": "for engines of your own in C++",
    "TriangleMeshView": "two arguments",
    "AuditFailure": "palpate.AuditFailure",
    "CollisionProblem": "ProblemGeometry, ProblemPair",
    "Stencil": "Stencils",
    "TrackedContact": "records of CollisionData.tracked_vertex_triangle and so on",
    "Ray": "origin, direction, t_min, t_max",
    "CellTypes": "fills structs of a C++ simulator",
    "TimeOfImpactSettings": "keyword arguments",
    "DistanceFieldSettings": "keyword arguments of DistanceField.build()",
    "SimplifySettings": "keyword arguments of simplify()",
    "MeshReadSettings": "keyword arguments of read_mesh_file()",
    "MeshWriteSettings": "keyword arguments of write_mesh_file()",
    "GuardedVertex": "rows (geometry, vertex)",
    "ContinuousSettings": "keyword arguments of PairSettings",
    "AutoSettings": "keyword arguments of PairSettings",
    "LeafSettings": "keyword arguments of PairSettings",
    "VertexPath": "pairs (geometry, vertices)",
}
FIELDS = {
    "PairSettings.continuous": "time_tolerance",
    "PairSettings.automatic": "motion_tolerance",
    "PairSettings.proxy": "widest_normal_cone",
}
NESTED = {"LooseOctree.Node": "OctreeNode", "FrameStatistics.Stages": "FrameStages"}


def snake(name):
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", "_", name).lower()


def code_of(path):
    """A header without comments, strings, preprocessor lines and words that no check needs."""
    text = re.sub(r"//[^\n]*|/\*.*?\*/", "", path.read_text(), flags=re.S)
    text = re.sub(r'"(\\.|[^"\\])*"', '""', re.sub(r"^\s*#[^\n]*", "", text, flags=re.M))
    text = re.sub(r"\btemplate\s*<[^<>]*>", "", text)
    words = r"\b(PALPATE_EXPORT|inline|static|constexpr|explicit|virtual|friend)\b"
    return re.sub(words, "", text)


def matching(text, start):
    """The index behind the brace that closes the one at `start`."""
    depth = 0
    for i in range(start, len(text)):
        depth += {"{": 1, "}": -1}.get(text[i], 0)
        if depth == 0:
            return i + 1
    raise AssertionError("braces do not match")


class Struct:
    def __init__(self, name):
        self.name, self.functions, self.fields = name, set(), set()


def strip_brackets(text, left, right):
    """Without what stands in these brackets, however deep."""
    out, depth = [], 0
    for c in text:
        depth += c == left
        if depth == 0:
            out.append(c)
        depth -= c == right and depth > 0
    return "".join(out)


class Headers:
    """Classes with their public members, free functions and enumerations of the headers."""

    def __init__(self):
        self.structs, self.functions, self.enums, self.constants = {}, set(), {}, set()
        for path in HEADERS:
            for body in re.finditer(r"namespace palpate\s*{", code_of(path)):
                text = code_of(path)
                start = body.end() - 1
                self.scan(text[start + 1 : matching(text, start) - 1], None, True)

    def scan(self, text, struct, public):
        """Takes nested types out of a scope, then reads the declarations that remain."""
        scope = f"{struct.name}." if struct and struct.name else ""
        pattern = re.compile(
            r"\benum class (\w+)[^;{]*{([^}]*)}|\b(class|struct)\s+(\w+)[^;{(]*{"
        )
        while match := pattern.search(text):
            visible = public or "public:" in text[: match.start()]
            end = match.end()
            if match[1]:
                if visible:
                    names = [n.split("=")[0].strip() for n in match[2].split(",")]
                    self.enums[scope + match[1]] = [n for n in names if n]
            else:
                end = matching(text, match.end() - 1)
                inner = Struct(scope + match[4])
                if visible:
                    self.structs[inner.name] = inner
                    self.scan(text[match.end() : end - 1], inner, match[3] == "struct")
            text = text[: match.start()] + " " + text[end:]
        if struct and not public:
            parts = re.split(r"\b(public|private|protected)\s*:", text)
            pairs = zip(parts[1::2], parts[2::2], strict=True)
            text = " ".join(part for access, part in pairs if access == "public")
        else:
            text = re.split(r"\bprivate\s*:", text)[0]
        self.read(strip_brackets(text, "{", "}"), struct)

    def read(self, text, struct):
        text = re.sub(r"\boperator\s*\(\)|\boperator\s*[^\s\w(]+", "operator_", text)
        end = r"\)\s*(const\b)?\s*(noexcept\b)?\s*(?=[A-Za-z~])(?!const\b|noexcept\b)"
        text = re.sub(end, "); ", text)  # the end of a function whose body was removed
        for statement in strip_brackets(text, "<", ">").split(";"):
            statement = statement.strip()
            if re.match(r"(using|template\s*using|class|struct)\b", statement):
                continue
            head = statement.split("=")[0] if "(" not in statement.split("=")[0] else statement
            function = re.search(r"([~\w]+)\s*\(", head)
            if function:
                name = function[1]
                if name[0].islower() and name not in ("operator_", "static_assert", "requires"):
                    (struct.functions if struct else self.functions).add(name)
            elif struct and re.match(r"[\w:]+", head):
                names = re.sub(r"=[^,]*", "", statement).split(",")
                struct.fields |= {n.split()[-1].strip("&* ") for n in names if n.split()}
            elif re.search(r"\bk[A-Z]\w*$", head.strip()):
                self.constants.add(head.split()[-1])


@pytest.fixture(scope="module")
def headers():
    return Headers()


def python_class(name):
    return getattr(palpate, NESTED.get(name, name.replace(".", "")), None)


def names_of(kind):
    return set(dir(kind)) | set(getattr(kind, "__annotations__", ()))


def fields_in_bindings():
    """For each C++ struct the members that Python sees as fields, from the lists of members."""
    result = {}
    for path in (SOURCE / "Fields").glob("*.h"):
        lists = re.findall(r"struct Fields<([\w:]+)> {(.*?)\n};", path.read_text(), re.S)
        for name, body in lists:
            members = {snake(member) for member in re.findall(r'field\("(\w+)"', body)}
            result[name.replace("::", ".")] = members
    return result


def test_the_headers_are_read(headers):
    classes = {"OctreeBasedCD", "SpatialQueries", "StepGuard", "CollisionData", "Snapshot"}
    assert classes <= set(headers.structs)
    assert len(headers.structs["OctreeBasedCD"].functions) > 40
    assert len(headers.structs["SpatialQueries"].functions) > 18
    assert {"weld", "findMeshDefects", "simplify", "setUp", "tangentsOf"} <= headers.functions
    assert headers.structs["Ray"].fields == {"origin", "direction", "tMin", "tMax"}
    assert len(headers.enums) >= 17


def test_every_function_has_a_name(headers):
    missing = {
        name
        for name in headers.functions
        if name not in FUNCTIONS and not hasattr(palpate, snake(name))
    }
    assert missing == set()
    assert set(FUNCTIONS) <= headers.functions, "an exception that is none"


def test_every_class_has_a_name(headers):
    recorded = fields_in_bindings()
    missing = {
        name
        for name in headers.structs
        if name not in CLASSES
        and name not in recorded
        and name.split(".")[0] not in ("AuditFailure", "CollisionProblem")
        and name != "CollisionData.Contents"
        and python_class(name) is None
    }
    assert missing == set()
    assert set(CLASSES) <= set(headers.structs), "an exception that is none"


def test_every_method_has_a_name(headers):
    missing = set()
    for struct in headers.structs.values():
        kind = python_class(struct.name)
        for name in struct.functions:
            if f"{struct.name}.{name}" in METHODS or struct.name in CLASSES:
                continue
            if snake(name) not in names_of(kind):
                missing.add(f"{struct.name}.{name}")
    assert missing == set()
    known = {f"{s.name}.{f}" for s in headers.structs.values() for f in s.functions}
    assert set(METHODS) <= known, "an exception that is none"


def test_every_field_has_a_name(headers):
    recorded = fields_in_bindings()
    missing = set()
    for struct in headers.structs.values():
        if struct.name in CLASSES or struct.name == "CollisionData.Contents":
            continue
        kind = python_class(struct.name)
        names = names_of(kind) | set(recorded.get(struct.name, ()))
        for field in struct.fields:
            name = FIELDS.get(f"{struct.name}.{field}", snake(field))
            if struct.name == "PairSettings" and field in ("continuous", "automatic", "proxy"):
                continue  # their members are fields of PairSettings in Python
            if name not in names and not field.startswith("k"):
                missing.add(f"{struct.name}.{field}")
    assert {m for m in missing if m.split(".")[0] not in CLASSES} == set()


def test_problems_have_all_fields(headers):
    for name, kind in ("Geometry", palpate.ProblemGeometry), ("Pair", palpate.ProblemPair):
        poses = {"rotation", "translation", "rotationBefore", "translationBefore"}
        fields = headers.structs[f"CollisionProblem.{name}"].fields - poses
        assert {f for f in fields if not hasattr(kind, snake(f))} == set()
    assert set(palpate.AuditFailure._fields) == {
        snake(f) for f in headers.structs["AuditFailure"].fields
    }


def test_every_enumeration_has_the_same_members(headers):
    enums = {name: members for name, members in headers.enums.items() if members}  # without ids
    for name, members in enums.items():
        kind = python_class(name)
        assert kind is not None and issubclass(kind, enum.IntEnum), name
        assert [snake(m).upper() for m in members] == [m.name for m in kind], name
        assert [m.value for m in kind] == list(range(len(members))), name
    kinds = [kind for kind in vars(palpate).values() if isinstance(kind, type)]
    here = [kind for kind in kinds if issubclass(kind, enum.IntEnum)]
    assert len(here) == len(enums)


def test_every_constant_has_a_name(headers):
    for name in headers.constants:
        assert hasattr(palpate, snake(name[1:]).upper()), name


def test_fields_of_records_are_those_of_the_bindings():
    bindings = fields_in_bindings()
    records = palpate.vertex_triangle_distance(*np.zeros((4, 3)))
    assert set(records.dtype.names) == bindings["VertexTriangleDistance"]


def test_public_names_are_listed():
    names = {n for n in vars(palpate) if not n.startswith("_")}
    assert set(palpate.__all__) <= names
