"""mirrors.py LIST ROOT: regenerates in the headers of C and the files of Python what mirrors the members of public
structs. LIST is the program that prints these members. WRITE=1 writes the files; else each difference is a fault.
Comments beside members stay, also where members stand in one line."""

import difflib
import json
import os
import pathlib
import re
import shutil
import subprocess
import sys

UNITS = {
    "Length": "L",
    "Direction": "unit",
    "StepFraction": "[0, 1] of the step",
    "Steps": "in steps",
    "Detections": "in detections",
    "Angle": "rad",
    "Milliseconds": "ms",
    "Bytes": "bytes",
}
# Structs of C that begin with `size`. Twins.h has the others.
SIZED = {
    "palpate_settings": "Settings",
    "palpate_pair_settings": "PairSettings",
    "palpate_filter": "CollisionFilter",
    "palpate_proxy_settings": "SurfaceProxySettings",
    "palpate_inside_settings": "InsideSettings",
    "palpate_validity": "Validity",
    "palpate_statistics": "FrameStatistics",
    "palpate_pair_statistics": "PairStatistics",
}
C_TYPES = {"bool": "uint8_t", "double": "double", "int32": "int", "uint8": "uint8_t", "uint32": "uint32_t",
           "uint64": "size_t"}
SHARP_TYPES = {"double": "double", "int32": "int", "uint8": "byte", "uint32": "uint", "uint64": "UIntPtr",
               "double[3]": "Vector", "double[4]": "Weights4", "uint32[2]": "Segment", "uint32[3]": "Triangle",
               "uint32[4]": "Tetrahedron", "Method": "Method", "Contacts": "ContactSet", "Sidedness": "Sides"}
ALIGNMENTS = {"int": 4, "uint32_t": 4, "palpate_id": 4, "uint8_t": 1}
IRREGULAR = {"PALPATE_SHAPE": "PALPATE_SHAPE_ELEMENT"}
# Structs that keyword arguments set, and those that only the library makes.
SETTINGS = ["OctreeSettings", "AuditSettings", "Settings", "PairSettings", "SurfaceProxySettings", "CollisionFilter",
            "InsideSettings"]
RESULTS = {"MemoryUse": "MemoryUse", "FrameStages": "FrameStatistics::Stages", "UnfinishedPair": "UnfinishedPair",
           "FrameStatistics": "FrameStatistics", "PairStatistics": "PairStatistics",
           "OctreeStatistics": "OctreeStatistics", "Validity": "Validity"}
PYTHON_TYPES = {"bool": "bool", "double": "float", "path": "str | os.PathLike[str]", "other": "Executor | None"}


def snake(name):
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name).lower()


class Mirrors:
    def __init__(self, lists, root):
        self.structs, self.enumerations, self.root = lists["structs"], lists["enumerations"], root
        twins = (root / "Source/Adapters/C/Twins.h").read_text()
        self.twins = dict(re.findall(r"^PALPATE_TWIN\((\w+), (\w+)\);", twins, re.M))
        self.in_c = {struct: c for c, struct in self.twins.items()}

    def members(self, struct, whole, outer=""):
        """Pairs of the name of the outer member and a member: those of a struct that is not in `whole` stand in its
        place."""
        for member in self.structs[struct]:
            kind, _, of = member["type"].partition(" ")
            if whole is self.in_c and not member["inC"]:
                continue
            if kind == "struct" and of not in whole:
                yield from self.members(of, whole, member["name"])
            else:
                yield outer, member

    # C

    def members_in_c(self, struct):
        """In the order of C (Structs.h)."""
        members = list(self.members(struct, self.in_c))
        if struct not in SIZED.values():
            return members
        return sorted(members, key=lambda pair: -ALIGNMENTS.get(self.c_declaration(*pair)[0], 8))

    def c_declaration(self, outer, member):
        """The type, the name and the length of an array."""
        kind, length = re.fullmatch(r"(.*?)(\[\d+\])?", member["type"]).groups()
        name = snake(member["name"])
        if kind.startswith("enum"):
            _, number, of = kind.split()
            c_type = C_TYPES[number] if of in self.enumerations else "palpate_id"
            name = f"{outer}_{name}" if outer else name
        elif kind.startswith("struct"):
            c_type = self.in_c[kind.split()[1]]
        else:
            c_type = "palpate_indices" if kind == "list uint32" else C_TYPES[kind]
        if outer and member["unit"] == "Milliseconds":
            name += "_ms"
        return c_type, name, length or ""

    def c_struct(self, struct, old):
        """The lines of the struct. `old` has comments, and members that stand in one line."""
        lines = {}  # by name: the number, the type and the comment of its line
        for number, line in enumerate(old.splitlines()):
            match = re.fullmatch(r"  (\w+) ([^;]*);\s*(///<.*)?", line)
            for name in re.findall(r"(\w+)(?:\[\d+\])*(?:,|$)", match[2]):
                lines[name] = number, match[1], match[3] or ""
        groups = []
        for outer, member in self.members_in_c(struct):
            c_type, name, length = self.c_declaration(outer, member)
            unit = UNITS.get(member["unit"])
            number, former, comment = lines.get(name, (-1, "", f"///< {unit}" if unit else ""))
            if former == "uint64_t" and c_type == "size_t":
                c_type = former
            if groups and number >= 0 and groups[-1][0] == (number, c_type):
                groups[-1][1].append(name + length)
            else:
                groups.append(((number, c_type), [name + length], comment))
        size = "  size_t size;\n" if "size" in lines else ""
        return size + "".join(f"  {c_type} {', '.join(names)};  {comment}\n"
                              for (_, c_type), names, comment in groups)

    def c_header(self, text):
        for c, struct in {**self.twins, **SIZED}.items():
            pattern = re.compile(rf"(typedef struct {c} {{\n)(.*?)(}} {c};)", re.S)
            assert pattern.search(text), c
            text = pattern.sub(lambda m: m[1] + self.c_struct(struct, m[2]) + m[3], text)

        def enumeration(match):
            names = [re.sub(r"(?<=[a-z])(?=[A-Z])", "_", name).upper() for name in self.enumerations[match[2]]]
            prefix = re.match(r"\s*(\w+)", match[1])[1].removesuffix(names[0])
            all_names = [IRREGULAR.get(prefix + name, prefix + name) for name in names]
            return f"enum {{ {', '.join(all_names)} }};  ///< {match[2]}"

        text = re.sub(r"enum \{([^}]*)\};\s*///< ([\w:]+)", enumeration, text)
        codes = "".join(f"  PALPATE_{snake(name).upper()},\n" for name in self.enumerations["ErrorCode"])
        return re.sub(r"(  PALPATE_OK,\n).*?(?=  PALPATE_INVALID_ARGUMENT)", lambda m: m[1] + codes, text, flags=re.S)

    # C#

    def sharp_declaration(self, outer, member):
        """The type and the name of a member, and the property of a flag or list, or None."""
        kind, name = member["type"], member["name"]
        public = name[0].upper() + name[1:]
        if kind == "list uint32":
            return "Indices", name, f"ReadOnlySpan<uint> {public} {{ get {{ return Of({name}); }} }}"
        if kind == "bool":
            return "byte", name, f"bool {public} {{ get {{ return {name} != 0; }} }}"
        if kind.startswith("enum"):
            _, number, of = kind.split()
            return SHARP_TYPES.get(of, SHARP_TYPES[number]), (outer or "").capitalize() + public, None
        of = self.sharp_names[self.in_c[kind.split()[1]]] if kind.startswith("struct") else SHARP_TYPES[kind]
        return of, public + "Id" if public in SHARP_TYPES.values() and public != of else public, None

    def sharp_struct(self, match):
        """The struct with its attributes, other functions and members that stand in one line."""
        struct = {**self.twins, **SIZED}.get(match[2])
        if not struct:
            return match[0]
        body = re.sub(r"^  public (?:bool|ReadOnlySpan<uint>) \w+ \{.*?\}(?: \}|\n  \})\n", "", match[4], flags=re.S | re.M)
        declaration = re.compile(r"^  (?:public |internal )?(?:\w+) ([\w, ]+);\n", re.M)
        lines = {name: number for number, line in enumerate(declaration.finditer(body)) for name in line[1].split(", ")}
        size = re.search(r"^.* Size;\n", body, re.M)
        groups, properties = [], []
        for outer, member in self.members_in_c(struct):
            of, name, property_text = self.sharp_declaration(outer, member)
            number = lines.get(name, -1)
            if groups and number >= 0 and groups[-1][0] == (number, of):
                groups[-1][1].append(name)
            else:
                groups.append(((number, of), [name], "" if property_text else "public "))
            if property_text and struct.endswith("Settings"):
                text = property_text[:-2] + f" set {{ {name} = value ? (byte)1 : (byte)0; }} }}"
                if len(text) > 110:
                    text = text.replace(" { get", " {\n    get").replace("; } }", "; }\n  }")
                property_text = text
            if property_text:
                properties.append(f"  public {property_text}\n")
        return (match[1] + (size[0] if size else "") + "".join(f"  {public}{of} {', '.join(names)};\n"
                                                               for (_, of), names, public in groups)
                + "".join(properties) + declaration.sub("", body) + "}\n")

    def sharp(self, text):
        struct = re.compile(r'(\[Native\("(\w+)"\)\]\n(?:public )?struct (\w+) \{\n)(.*?)^\}\n', re.S | re.M)
        self.sharp_names = {match[2]: match[3] for match in struct.finditer(text)}
        return struct.sub(self.sharp_struct, text)

    # Python

    def python_type(self, member, takes_names):
        kind = member["type"]
        if kind.startswith("list"):
            return f"list[{self.python_type({'type': kind.removeprefix('list ')}, False)}]"
        if kind.startswith("enum"):
            name = kind.split()[2].replace("::", "")
            if kind.split()[2] not in self.enumerations:
                return "int"
            return f"{name} | {name}Name" if takes_names else name
        if kind.startswith("struct"):
            of = kind.split()[1]
            return next((name for name, struct in RESULTS.items() if struct == of), of)
        return PYTHON_TYPES.get(kind, "int")

    def python_default(self, member, old):
        kind, value = member["type"], member["default"]
        if kind.startswith("list"):
            return None
        if kind.startswith("struct"):
            return f"field(default_factory={kind.split()[1]})"
        if kind.startswith("enum"):
            return f"{kind.split()[2]}.{snake(value).upper()}"
        if kind in ("path", "other"):
            return {"path": '""', "other": "None"}[kind]
        number = repr(float(value)) if kind == "double" else value.capitalize()
        return old if old and re.fullmatch(r"[-\w.]+", old) and eval(old) == eval(number) else number

    def python_members(self, struct):
        return [member for _, member in self.members(struct, (*SETTINGS, *RESULTS.values()))]

    def dataclass(self, text, name, struct, has_defaults):
        """The class with the docstring and the functions that it had."""
        def lines(match):
            old = dict(re.findall(r"^    (\w+): .* = (.*)$", match[2], re.M))
            members = []
            for member in self.python_members(struct):
                attribute = snake(member["name"])
                line = f"    {attribute}: {self.python_type(member, name in SETTINGS)}"
                value = self.python_default(member, old.get(attribute)) if has_defaults else None
                members.append(f"{line} = {value}\n" if value else line + "\n")
            return match[1] + "".join(members)

        pattern = re.compile(rf'(class {name}(?:\(\w+\))?:\n    """.*?"""\n\n)((?:    \w+: [^\n]*\n)+)', re.S)
        assert pattern.search(text), name
        return pattern.sub(lines, text, count=1)

    def python_settings(self, text):
        for name in SETTINGS:
            text = self.dataclass(text, name, name, True)
        return text

    def python_results(self, text):
        for name, struct in RESULTS.items():
            text = self.dataclass(text, name, struct, name == "Validity")
        return text

    def python_enumerations(self, text):
        for enumeration, names in self.enumerations.items():
            name = enumeration.replace("::", "")
            members = "".join(f"    {snake(each).upper()} = {i}\n" for i, each in enumerate(names))
            pattern = re.compile(rf'(class {name}\(_Named\):\n    """[^"]*"""\n\n)(?:    \w+ = \d+\n)+')
            assert pattern.search(text), name
            text = pattern.sub(lambda m: m[1] + members, text)
            values = ", ".join(f'"{snake(each)}"' for each in names)
            line = f"{name}Name = Literal[{values}]\n"
            if len(line) > 89:
                line = f"{name}Name = Literal[\n    {values}\n]\n"
            text = re.sub(rf"^{name}Name = Literal\[[^]]*\]\n", lambda m: line, text, flags=re.M)
        return text

    def python_stub(self, text):
        """Keyword arguments behind an argument with settings."""
        def keywords(match):
            return match[1] + "".join(f"        {snake(m['name'])}: {self.python_type(m, True)} = ...,\n"
                                      for m in self.python_members(match[2]))

        return re.sub(r"(        \w+: (\w+) \| None = None,\n        \*,\n)(?:        \w+: .* = \.\.\.,\n)+",
                      keywords, text)


def formatted(text, path):
    tool = shutil.which("clang-format-14")
    if not tool:
        print("skipped: clang-format-14 is not installed")
        sys.exit(77)
    return subprocess.run([tool, f"--assume-filename={path}"], input=text, capture_output=True, text=True,
                          check=True).stdout


def main():
    root = pathlib.Path(sys.argv[2])
    lists = json.loads(subprocess.run([sys.argv[1]], capture_output=True, text=True, check=True).stdout)
    mirrors = Mirrors(lists, root)
    package = "Source/Adapters/Python/palpate/"
    header = "Source/Public/palpate/palpate_c.h"
    faults = False
    for name, generate in {
        header: lambda text: formatted(mirrors.c_header(text), root / header),
        "Examples/CSharp/Palpate.cs": mirrors.sharp,
        package + "_settings.py": mirrors.python_settings,
        package + "_results.py": mirrors.python_results,
        package + "_enums.py": mirrors.python_enumerations,
        package + "_palpate.pyi": mirrors.python_stub,
    }.items():
        old = (root / name).read_text()
        new = generate(old)
        if new != old and os.environ.get("WRITE"):
            (root / name).write_text(new)
        elif new != old:
            faults = True
            print(*difflib.unified_diff(old.splitlines(), new.splitlines(), name, "generated", lineterm=""), sep="\n")
    sys.exit(faults)


main()
