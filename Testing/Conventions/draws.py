#!/usr/bin/env python3
"""draws.py FILE...: prints where the order of two random draws is not defined, one place a line.

C++ does not say in which order the arguments of a call and the operands of an operator are computed. Two draws from
generators in two of them give other numbers with another compiler. Braces, `&&`, `||`, `?:`, `,`, `<<`, `>>` and
assignments have an order, and so has a call's object before its arguments.

A generator is a variable of a type in GENERATORS. A draw is a call of a generator or of its function, a call with a
generator as argument, or of a lambda that draws.
"""
import pathlib
import re
import sys

GENERATORS = {"Random", "RandomPoints", "HardCases", "DistanceCases", "mt19937", "mt19937_64", "minstd_rand",
              "default_random_engine"}
NO_DRAW = {"min", "max", "isDecided", "isOver"}  # functions of generators
TOKEN = re.compile(r'R"\((?:.|\n)*?\)"|"(?:\\.|[^"\\\n])*"|(?<![0-9A-Fa-f])\'(?:\\.|[^\'\\\n])+\'|[A-Za-z_]\w*|'
                   r"\d(?:[\w.']|[eEpP][+-])*|->|<<=?|>>=?|&&|\|\||::|[-+*/%&|^!=<>]=|\+\+|--|[^\s]")
OPEN, CLOSE = {"(": ")", "[": "]", "{": "}"}, {")", "]", "}"}
ORDERED = {",", ";", "?", ":", "&&", "||", "<<", ">>", "=", "+=", "-=", "*=", "/=", "%=", "&=", "|=", "^=", "<<=", ">>=",
           "return", "case", "else", "do"}
OPERATORS = {"+", "-", "*", "/", "%", "&", "|", "^", "<", ">", "==", "!=", "<=", ">="}
NO_CALL = {"if", "for", "while", "switch", "catch", "return", "sizeof", "decltype", "noexcept", "alignas", "TEST", "TEST_P",
           "TEST_F", "requires"}


def tokens_of(text):
    text = re.sub(r"//[^\n]*|/\*(?:.|\n)*?\*/", lambda m: "\n" * m.group().count("\n"), text)
    text = re.sub(r"^[ \t]*#(?:[^\n]*\\\n)*[^\n]*", lambda m: "\n" * m.group().count("\n"), text, flags=re.M)
    line, last, out = 1, 0, []
    for match in TOKEN.finditer(text):
        line += text.count("\n", last, match.start())
        last = match.start()
        out.append((match.group(), line))
    return out


def tree_of(tokens):
    """Nested lists: ["(", children...] for each pair of brackets, tokens elsewhere."""
    root = ["{"]
    stack = [root]
    for token in tokens:
        if token[0] in OPEN:
            child = [token[0]]
            stack[-1].append(child)
            stack.append(child)
        elif token[0] in CLOSE:
            if len(stack) > 1:
                stack.pop()
        else:
            stack[-1].append(token)
    return root


def is_token(node, text=None):
    return isinstance(node, tuple) and (text is None or node[0] == text)


def is_name(node):
    return isinstance(node, tuple) and (node[0][0].isalpha() or node[0][0] == "_")


def is_list(node, kind):
    return isinstance(node, list) and node[0] == kind


def lambda_end(nodes, i):
    """The end of the lambda that begins at nodes[i], or i."""
    if not is_list(nodes[i], "[") or (i > 0 and (is_name(nodes[i - 1]) or is_list(nodes[i - 1], "(") or
                                                 is_list(nodes[i - 1], "["))
                                      and not is_token(nodes[i - 1], "return")):
        return i
    j = i + 1
    while j < len(nodes) and not is_list(nodes[j], "{"):
        if is_token(nodes[j]) and nodes[j][0] in (";", ","):
            return i
        j += 1
    return j + 1 if j < len(nodes) else i


class File:
    def __init__(self, path, tree):
        self.path, self.tree, self.faults, self.known = path, tree, set(), {}
        self.generators, self.lambdas = set(), set()
        self.find_generators(tree)
        while True:
            count = len(self.lambdas)
            self.known.clear()
            self.find_lambdas(tree)
            if len(self.lambdas) == count:
                break

    def find_generators(self, nodes):
        for i, node in enumerate(nodes):
            if isinstance(node, list):
                self.find_generators(node)
            elif is_name(node) and i > 1:
                before = i - 1
                while before > 1 and is_token(nodes[before]) and nodes[before][0] in ("&", "&&"):
                    before -= 1
                if is_name(nodes[before]) and nodes[before][0] in GENERATORS:
                    self.generators.add(node[0])

    def find_lambdas(self, nodes):
        for i, node in enumerate(nodes):
            if isinstance(node, list) and i > 0:
                self.find_lambdas(node)
            if not is_name(node) or i + 2 >= len(nodes):
                continue
            if is_token(nodes[i + 1], "=") and is_list(nodes[i + 2], "["):
                end = lambda_end(nodes, i + 2)
                if end > i + 2 and self.has_draw(nodes[end - 1][1:]):
                    self.lambdas.add(node[0])
            # A member function, whose generator is no parameter.
            if is_list(nodes[i + 1], "(") and is_list(nodes[i + 2], "{") and i > 0 and \
                    (is_name(nodes[i - 1]) or is_token(nodes[i - 1], "&") or is_token(nodes[i - 1], ">")) and \
                    not any(is_name(child) and child[0] in GENERATORS for child in nodes[i + 1][1:]) and \
                    self.has_draw(nodes[i + 2][1:]):
                self.lambdas.add(node[0])

    def has_draw(self, nodes):
        """Whether the evaluation of nodes draws. Bodies of lambdas are not evaluated."""
        i = 0
        while i < len(nodes):
            node = nodes[i]
            end = lambda_end(nodes, i)
            if end > i:
                i = end
                continue
            if is_list(node, "(") and i > 0:
                callee = nodes[i - 1]
                if is_name(callee):
                    member = i > 2 and is_token(nodes[i - 2]) and nodes[i - 2][0] in (".", "->")
                    if callee[0] in self.generators and not member and not self.declares(nodes, i - 1):
                        return True
                    if callee[0] in self.lambdas and not member:
                        return True
                    if member and is_name(nodes[i - 3]) and nodes[i - 3][0] in self.generators and \
                            callee[0] not in NO_DRAW:
                        return True
                if not (is_name(callee) and callee[0] in NO_CALL):
                    if any(len(part) == 1 and is_name(part[0]) and part[0][0] in self.generators
                           for part in self.arguments(node)):
                        return True
            if isinstance(node, list):
                if id(node) not in self.known:
                    self.known[id(node)] = self.has_draw(node[1:])
                if self.known[id(node)]:
                    return True
            i += 1
        return False

    @staticmethod
    def declares(nodes, i):
        """Whether nodes[i], before parentheses, is declared there: `Random random(1)`."""
        return i > 0 and is_name(nodes[i - 1]) and nodes[i - 1][0] not in ("return", "case", "else", "do")

    @staticmethod
    def arguments(node):
        parts = [[]]
        for child in node[1:]:
            if is_token(child, ","):
                parts.append([])
            else:
                parts[-1].append(child)
        return parts

    def line_of(self, node):
        if isinstance(node, tuple):
            return node[1]
        for child in node[1:]:
            line = self.line_of(child)
            if line:
                return line
        return 0

    def check(self, nodes=None):
        nodes = self.tree if nodes is None else nodes
        # Operands of one expression.
        operands, operand = [], []

        def finish():
            nonlocal operands, operand
            operands.append(operand)
            drawing = [part for part in operands if part and self.has_draw(part)]
            if len(drawing) > 1:
                self.faults.add(self.line_of(["("] + drawing[1]))
            operands, operand = [], []

        i = 1
        while i < len(nodes):
            node = nodes[i]
            if is_token(node) and node[0] in ORDERED:
                finish()
            elif is_token(node) and node[0] in OPERATORS:
                operands.append(operand)
                operand = []
            elif is_list(node, "{") and not self.is_value(nodes, i):
                operand.append(node)
                operand.pop()
                finish()
            else:
                end = lambda_end(nodes, i)
                if end > i:
                    for part in nodes[i:end]:
                        if isinstance(part, list):
                            self.check(part)
                    i = end
                    continue
                operand.append(node)
            if is_list(node, "(") and not any(is_token(child, ";") for child in node[1:]):
                callee = nodes[i - 1] if i > 1 else None
                if callee is not None and not (is_name(callee) and callee[0] in NO_CALL) and \
                        (is_name(callee) or is_token(callee, ">") or is_list(callee, "(") or is_list(callee, "]")):
                    drawing = [part for part in self.arguments(node) if self.has_draw(part)]
                    if len(drawing) > 1:
                        self.faults.add(self.line_of(["("] + drawing[1]))
            if isinstance(node, list):
                self.check(node)
            i += 1
        finish()

    @staticmethod
    def is_value(nodes, i):
        """Whether the braces nodes[i] are a value, not a block."""
        if i < 2:
            return nodes[0] == "("
        before = nodes[i - 1]
        return (is_name(before) and before[0] not in ("else", "do", "try", "const", "override", "noexcept")) or \
            (is_token(before) and before[0] in (",", "=", ">", "return", "+", "-", "*", "/", "?", ":", "<<"))


def main():
    faults = 0
    any_generator = re.compile(r"\b(" + "|".join(sorted(GENERATORS)) + r")\b")
    for path in sys.argv[1:]:
        text = pathlib.Path(path).read_text()
        if not any_generator.search(text):
            continue
        file = File(path, tree_of(tokens_of(text)))
        file.check()
        for line in sorted(file.faults):
            print(f"{path}:{line}: the order of two random draws is not defined")
            faults = 1
    return faults


if __name__ == "__main__":
    sys.exit(main())
