"""pythonReference.py OUT: writes the pages of the Python reference into the folder OUT.

Signatures come from the stubs (_palpate.pyi) and from the package's Python files. Docstrings of the stubs' names stand in
the C++ files of the binding, which are read as text: the site is built without a compiler.
Testing/Python/test_reference.py compares them with those of the built package.
"""
import ast
import pathlib
import re
import sys

ADAPTER = pathlib.Path(__file__).resolve().parents[2] / "Source" / "Adapters" / "Python"
PACKAGE = ADAPTER / "palpate"
STRING = re.compile(r'R"\((.*?)\)"|"((?:[^"\\\n]|\\.)*)"', re.DOTALL)
# A class with its variable, or a call that adds a name to one.
CLASS = r"(?:py::class_<[^;()]*?>|\w+Class)\s*(?P<variable>\w*)\(\s*module,"
CALL = r"(?P<owner>\w+|\))\s*\.def(?:_property_readonly|_static)?\(|\badd(?:Property|List|Tracked|Normals)\((?P<first>\w+),"
ALIASES = {"_Floats": "ndarray[float64]", "_Indices": "ndarray[uint32]", "_Bools": "ndarray[bool]", "_Records": "recarray",
           "_Record": "record", "_Path": "str | PathLike", "_Array": "ArrayLike", "_Progress": "Callable[[float], bool | None]"}


def argumentsFrom(code, start):
    """The text from behind an opening parenthesis to the one that closes it. The code has no parenthesis in a string."""
    depth, i = 1, start
    while depth > 0:
        depth += {"(": 1, ")": -1}.get(code[i], 0)
        i += 1
    return code[start:i - 1]


def textIn(arguments, strings):
    """The name, and the last literal between commas of the outermost level: the docstring."""
    level, parts = 0, [""]
    for c in arguments:
        level += (c in "({[") - (c in ")}]")
        if c == "," and level == 0:
            parts.append("")
        else:
            parts[-1] += c
    literals = ["".join(strings[int(n)] for n in re.findall(r"\x00(\d+)\x00", part)) for part in parts
                if re.fullmatch(r"\s*(?:\x00\d+\x00\s*)+", part)]
    return (literals[0], literals[-1] if len(literals) > 1 else "") if literals else ("", "")


def docstringsOfBinding():
    """{"Class", "Class.member" or "function": docstring} of all names that the C++ files bind."""
    sources, classes, found = [], {"module": ""}, {}
    for path in sorted(ADAPTER.glob("*.cpp")):
        strings = []

        def keep(match, strings=strings):
            strings.append(match[1] if match[1] is not None else match[2].replace("\\n", "\n").replace('\\"', '"'))
            return f"\x00{len(strings) - 1}\x00"

        code = re.sub(r"^\s*#[^\n]*", "", path.read_text(encoding="utf-8"), flags=re.MULTILINE)
        code = re.sub(r"//[^\n]*", "", STRING.sub(keep, code)).replace("'(", "").replace("')", "")
        sources.append((code, strings))
        for match in re.finditer(CLASS, code):
            name, text = textIn(argumentsFrom(code, match.end()), strings)
            # A class without a variable is named by the calls that follow it.
            classes[match["variable"] or f"{path}:{match.start()}"], found[name] = name, text
    for code, strings in sources:
        owner = ""
        for match in re.finditer(f"{CLASS}|{CALL}", code):
            name, text = textIn(argumentsFrom(code, match.end()), strings)
            if match["variable"] is not None:
                owner = name
                continue
            variable = match["owner"] or match["first"]
            owner = classes.get(variable, owner) if variable != ")" else owner
            if name and not name.startswith("_"):
                found[f"{owner}.{name}" if owner else name] = text
    return found


def escaped(text):
    return re.sub(r"([\\*|])", r"\\\1", text).replace("`", "``")


def reStructured(text, indent):
    """A docstring. Lines "name  what it is" become a list, indented lines code, and the others paragraphs."""
    lines = text.strip().splitlines()
    if lines and re.match(r"\w+\(.*\) -> ", lines[0]):  # the signature, which stands above
        lines = lines[1:]
    blocks = [""]
    for line in lines:
        item = re.match(r"(\S.*?)  +(\S.*)", line)
        if item:
            names = ", ".join(f"``{name}``" for name in item[1].split(", "))
            blocks.append(f"- {names}: {escaped(item[2])}")
        elif not line:
            blocks.append("")
        elif line[0] == " " and blocks[-1].startswith("- "):
            blocks[-1] += " " + escaped(line.strip())
        elif line[0] == " ":
            blocks[-1] += ("" if blocks[-1] else "::\n") + f"\n{line}"
        elif blocks[-1].startswith("- "):
            blocks.append(escaped(line))
        else:
            blocks[-1] += f"\n{escaped(line)}" if blocks[-1] else escaped(line)
    paragraphs = "\n\n".join(block for block in blocks if block).splitlines()
    return "".join(f"{indent}{line}".rstrip() + "\n" for line in paragraphs)


def written(node):
    return re.sub(r"\bnpt\.(?=ArrayLike)|\b_[A-Z]\w+\b", lambda name: ALIASES.get(name[0], ""), ast.unparse(node))


def signatureOf(function, isMethod):
    arguments = function.args
    if isMethod and not any(written(each) == "staticmethod" for each in function.decorator_list):
        (arguments.posonlyargs or arguments.args).pop(0)
    return f"({written(arguments)})" + (f" -> {written(function.returns)}" if function.returns else "")


class Page:
    def __init__(self, title, introduction, module="palpate"):
        self.title, self.introduction, self.module, self.names, self.text = title, introduction, module, [], ""

    def add(self, kind, name, text, indent="", options=""):
        self.text += f"{indent}.. py:{kind}:: {name}\n{options}\n{reStructured(text, indent + '   ')}\n"


def addFunctions(page, functions, docstrings, prefix="", indent=""):
    """Functions or methods. Overloads are one entry with several signatures."""
    for name in dict.fromkeys(function.name for function in functions):
        own = [function for function in functions if function.name == name]
        decorators = {written(each) for function in own for each in function.decorator_list}
        text = docstrings.get(prefix + name) or ast.get_docstring(own[0]) or ""
        if "property" in decorators:
            page.add("property", name, text, indent, f"{indent}   :type: {written(own[0].returns)}\n")
            continue
        kind = "function" if not prefix else "method"
        lines = f"\n{indent}{' ' * len(f'.. py:{kind}:: ')}".join(name + signatureOf(each, bool(prefix)) for each in own)
        page.add(kind, lines, text, indent, f"{indent}   :staticmethod:\n" if "staticmethod" in decorators else "")


def addClass(page, node, docstrings):
    text = docstrings.get(node.name) or ast.get_docstring(node) or ""
    methods = [each for each in node.body if isinstance(each, ast.FunctionDef)]
    start = [each for each in methods if each.name == "__init__"]
    fields = [each for each in node.body if isinstance(each, ast.AnnAssign)]
    members = [each.targets[0].id for each in node.body if isinstance(each, ast.Assign)]
    if start:
        head = node.name + signatureOf(start[0], True).removesuffix(" -> None")
    elif fields:
        isTuple = any(written(base) == "NamedTuple" for base in node.bases)
        head = node.name + "(" + ("" if isTuple else "*, ") + ", ".join(
            f"{each.target.id}: {written(each.annotation)}" + (f" = {written(each.value)}" if each.value else "") for each in fields) + ")"
        head = re.sub(r"field\(default_factory=(\w+)\)", r"\1()", head)
    else:
        head = node.name
    page.names.append(node.name)
    page.add("class", head, text)
    for member in members:
        page.add("attribute", member, "", "   ")
    public = [each for each in methods if not each.name.startswith("_")]
    addFunctions(page, public, docstrings, f"{node.name}.", "   ")


def pages():
    """All pages, in the order of the table of contents."""
    docstrings = docstringsOfBinding()
    exported = re.findall(r'^    "(\w+)",$', (PACKAGE / "__init__.py").read_text(encoding="utf-8"), re.MULTILINE)

    def definitions(file):
        nodes = ast.parse((PACKAGE / file).read_text(encoding="utf-8")).body
        return [node for node in nodes if isinstance(node, (ast.ClassDef, ast.FunctionDef)) and node.name in exported]

    stubs = definitions("_palpate.pyi")
    result = []
    for node in sorted(stubs, key=lambda node: node.name != "OctreeBasedCD"):  # the others keep their order
        if isinstance(node, ast.ClassDef):
            result.append(Page(node.name, ""))
            addClass(result[-1], node, docstrings)
    functions = Page("Functions", "")
    for node in [*definitions("_meshes.py"), *(each for each in stubs if isinstance(each, ast.FunctionDef))]:
        functions.names += [node.name] if node.name not in functions.names else []
        addFunctions(functions, [node], docstrings)
    result.append(functions)
    for file in sorted(set(PACKAGE.glob("_*.py")) - {PACKAGE / "__init__.py", PACKAGE / "_meshes.py"}):
        module = ast.parse(file.read_text(encoding="utf-8"))
        page = Page({"_enums": "Enumerations"}.get(file.stem, file.stem.strip("_").capitalize()), ast.get_docstring(module))
        for node in definitions(file.name):
            if isinstance(node, ast.ClassDef):
                addClass(page, node, docstrings)
            else:
                page.names.append(node.name)
                addFunctions(page, [node], docstrings)
        result += [page] if page.names else []
    text = (PACKAGE / "cohort.py").read_text(encoding="utf-8")
    page, names = Page("Cohort", ast.get_docstring(ast.parse(text)), "palpate.cohort"), re.search(r"^__all__ = (.*)$", text, re.M)[1]
    for node in ast.parse(text).body:
        if isinstance(node, ast.ClassDef) and node.name in ast.literal_eval(names):
            addClass(page, node, docstrings)
        elif isinstance(node, ast.FunctionDef) and node.name in ast.literal_eval(names):
            page.names.append(node.name)
            addFunctions(page, [node], docstrings)
    return [*result, page]


def main(folder):
    folder = pathlib.Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    table = ""
    for page in pages():
        introduction = f"{reStructured(page.introduction, '')}\n" if page.introduction else ""
        (folder / f"{page.title}.md").write_text(
            f"# {page.title} (Python)\n\n```{{eval-rst}}\n.. highlight:: python\n\n{introduction}.. py:currentmodule:: {page.module}\n\n{page.text}```\n", encoding="utf-8")
        table += f"| [{page.title}]({page.title}.md) | {', '.join(f'`{name}`' for name in page.names)} |\n"
    toctree = "\n".join(page.title for page in pages())
    (folder / "index.md").write_text(f"""# Python API

This reference lists the names of the package `palpate`. [Python](/Docs/Python.md) is the start page. Lengths are in L, the
length unit of your positions. `ArrayLike` stands for all that NumPy converts to an array.

| page | names |
|---|---|
{table}
```{{toctree}}
:hidden:
:maxdepth: 1
{toctree}
```
""", encoding="utf-8")


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    main(sys.argv[1])
