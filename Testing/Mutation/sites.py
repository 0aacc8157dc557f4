"""Places in C++ source where a fault can be planted, found in the tokens of a formatted file.

The source is formatted by clang-format. A comparison therefore has spaces on both sides, and a bracket of a template
has none. Each site is a replacement of one range of the text; `{0}` in it stands for the condition that selects it.
"""
import re
from dataclasses import dataclass

TOKEN = re.compile(
    r'(?P<skip>\s+|//[^\n]*|/\*.*?\*/)|(?P<directive>^[ \t]*#(?:[^\n]*\\\n)*[^\n]*)'
    r'|(?P<string>R"\((?:.|\n)*?\)"|"(?:\\.|[^"\\])*"|\'(?:\\.|[^\'\\])+\')'
    r"|(?P<number>\.?\d(?:[eEpP][+-]|['\w.])*)|(?P<name>[A-Za-z_]\w*)"
    r'|(?P<sign><=>|<<=|->\*|\.\.\.|::|->|\+\+|--|&&|\|\||[=!<>+\-*/%&|^]=|<<|.)', re.M | re.S)

OPEN, CLOSE = {'(': ')', '[': ']', '{': '}'}, {')', ']', '}'}
ASSIGN = {'=', '+=', '-=', '*=', '/=', '%=', '&=', '|=', '^=', '<<='}
STATEMENT = {'return', 'else', 'do', 'case', 'throw', 'goto', 'delete'}
FLIPPED = {'<': '>', '>': '<', '<=': '>=', '>=': '<=', '==': '!=', '!=': '=='}
ENDPOINT = {'<': '<=', '<=': '<', '>': '>=', '>=': '>'}
LANES = {'Gt': 'Lt', 'Lt': 'Gt', 'Ge': 'Le', 'Le': 'Ge'}
LEVEL = {'||': 1, '&&': 2, '|': 3, '^': 4, '&': 5, '==': 6, '!=': 6, '<': 7, '>': 7, '<=': 7, '>=': 7, '<=>': 8,
         '<<': 9, '+': 10, '-': 10}
# Contents of these are no expressions at run time.
UNEVALUATED = {'static_assert', 'PALPATE_ASSERT', 'alignas', 'decltype', 'sizeof', 'noexcept', 'HWY_EXPORT', 'requires'}
# A bound that is missing changes an answer only within one rounding, and most bounds have room for several. The fault
# therefore is a bound on the wrong side.
OPPOSITE = {'roundedDown': 'roundedUp', 'roundedUp': 'roundedDown', 'down': 'up', 'up': 'down', 'nextDown': 'nextUp',
            'nextUp': 'nextDown'}
BOUND_CALLS = {*OPPOSITE, 'outward'}
BOUND_NAME = re.compile(r'k\w*(Error|Slack|Margin|Guard|Underflow|Absolute|Relative)\w*$'
                        r'|(error|slack|margin|tiny)$|\w+(Error|Slack|Margin)$')


@dataclass
class Token:
    kind: str
    text: str
    start: int
    end: int


@dataclass
class Site:
    kind: str
    start: int
    end: int
    after: str  # the text that replaces [start, end) in the faulty program


class File:
    def __init__(self, text):
        self.text = text
        self.tokens = [Token(m.lastgroup, m.group(), m.start(), m.end()) for m in TOKEN.finditer(text)
                       if m.lastgroup not in ('skip', 'directive')]
        self.match = {}
        self.pair_brackets()
        self.quiet = self.quiet_tokens()

    def at(self, i):
        return self.tokens[i].text if 0 <= i < len(self.tokens) else ''

    def spaced(self, i):
        t = self.tokens[i]
        return self.text[t.start - 1].isspace() and self.text[t.end:t.end + 1].isspace()

    def pair_brackets(self):
        stack = []
        for i, t in enumerate(self.tokens):
            if t.kind != 'sign':
                continue
            if t.text in OPEN:
                stack.append(i)
            elif t.text in CLOSE and stack:
                self.match[i] = stack.pop()
                self.match[self.match[i]] = i
        angles = []
        for i, t in enumerate(self.tokens):
            if t.text == '<' and i > 0 and self.tokens[i - 1].kind == 'name' and \
                    (not self.spaced(i) and self.tokens[i - 1].end == t.start or self.at(i - 1) == 'template'):
                angles.append(i)
            elif t.text == '>' and angles and not self.spaced(i):
                self.match[i] = angles.pop()
                self.match[self.match[i]] = i
            elif t.text in (';', '{'):
                angles = []

    def quiet_tokens(self):
        quiet = set()
        for i, t in enumerate(self.tokens):
            last = i
            if t.text in UNEVALUATED and self.at(i + 1) == '(':
                last = self.match.get(i + 1, i)
            elif t.text == 'template' and i + 1 in self.match:
                last = self.match[i + 1]
            elif t.text == 'enum' or t.text in ('using', 'typedef', 'case'):
                while self.at(last) not in (';', ':', ''):
                    last += 1
            elif t.text == 'constexpr' and self.at(i - 1) == 'if':
                last = self.match.get(i + 1, i)
            elif t.text == 'constexpr':
                while self.at(last) not in ('=', '{', '(', ';', ''):
                    last += 1
                while self.at(last) not in (';', '(', '') or self.at(last) == '(' and self.at(last - 1) in ASSIGN:
                    last += 1
            elif t.text == 'operator':
                last = i + 1
            if last > i:
                quiet.update(range(i, last + 1))
        return quiet

    def is_operand_end(self, i):
        t = self.tokens[i]
        return t.kind in ('number', 'string') or t.text in (')', ']', '}') or \
            t.kind == 'name' and t.text not in STATEMENT or t.text == '>' and i in self.match

    def level(self, i):
        """How strongly the token binds as a binary operator; None if it is no such operator."""
        t = self.tokens[i]
        if t.kind != 'sign' or t.text not in LEVEL or i in self.match or not self.spaced(i):
            return None
        return LEVEL[t.text] if i > 0 and self.is_operand_end(i - 1) else None

    def left(self, i, level):
        """The first token of the left operand of the operator i."""
        j = i
        while j > 0:
            k = j - 1
            text = self.at(k)
            if text in ('(', '[', '{', ',', ';', '?', ':') or text in ASSIGN or text in STATEMENT:
                break
            own = self.level(k)
            if own is not None and own < level:
                break
            if text == '}' and self.tokens[j].kind in ('name', 'number') or text == '}' and self.at(j) in ('(', '!', '*', '-'):
                break
            if self.match.get(k, -1) > k:
                break  # within the brackets of a template
            j = self.match.get(k, k)
        return j

    def right(self, i, level):
        """One past the last token of the right operand of the operator i."""
        j = i + 1
        while j < len(self.tokens):
            text = self.at(j)
            if text in CLOSE or text in (',', ';', '?', ':') or text in ASSIGN or self.match.get(j, j) < j:
                break
            own = self.level(j)
            if own is not None and own <= level:
                break
            j = self.match.get(j, j) + 1
        return j

    def slice(self, first, last):
        """The text of the tokens [first, last) on one line, or None if a comment is in it."""
        text = self.text[self.tokens[first].start:self.tokens[last - 1].end]
        return None if '//' in text or '/*' in text else re.sub(r'\s*\n\s*', ' ', text)

    def in_for_condition(self, i):
        depth = 0
        for k in range(i - 1, -1, -1):
            text = self.at(k)
            if text in CLOSE:
                depth += 1
            elif text in OPEN:
                depth -= 1
                if depth < 0:
                    return self.at(k) == '(' and self.at(k - 1) == 'for'
            elif text == '}' or text == '{':
                return False
        return False

    def sites(self):
        for i, t in enumerate(self.tokens):
            if i in self.quiet or i == 0:
                continue
            if t.kind == 'sign':
                yield from self.operator_sites(i)
            elif t.kind == 'name':
                yield from self.name_sites(i)

    def binary(self, i, kind, after):
        level = self.level(i)
        first, last = self.left(i, level), self.right(i, level)
        a, b = self.slice(first, i) if first < i else None, self.slice(i + 1, last) if i + 1 < last else None
        if a is None or b is None:
            return
        yield Site(kind, self.tokens[first].start, self.tokens[last - 1].end, after(a, b))

    def operator_sites(self, i):
        text, level = self.at(i), self.level(i)
        if text == '[' and self.at(i + 1) in ('0', '1', '2') and self.at(i + 2) == ']' and self.is_subscript(i):
            t = self.tokens[i + 1]
            yield Site('off by one', t.start, t.end, {'0': '1', '1': '2', '2': '1'}[t.text])
        if level is None:
            return
        if text in FLIPPED:
            counts = self.in_for_condition(i) or self.is_count(i + 1) or self.is_count(i - 1)
            if text in ENDPOINT and counts:
                yield from self.binary(i, 'off by one', lambda a, b: f'({a}) {ENDPOINT[text]} ({b})')
            if not self.in_for_condition(i):
                yield from self.binary(i, 'comparison', lambda a, b: f'({a}) {FLIPPED[text]} ({b})')
        elif text in ('&&', '||'):
            yield from self.binary(i, 'logic', lambda a, b: f'({a}) {"||" if text == "&&" else "&&"} ({b})')
        elif text in '+-':
            if self.at(i + 1) == '1' and (self.level(i + 2) or 0) <= 10 and self.at(i + 2) not in ('.', '*', '/', '%'):
                yield from self.binary(i, 'off by one', lambda a, b: f'({a}) {text} 0')
            else:
                yield from self.binary(i, 'sign', lambda a, b: f'({a}) {"-" if text == "+" else "+"} ({b})')

    def is_subscript(self, i):
        """Whether a value, and not a declared array, is before the bracket."""
        before = self.tokens[i - 1]
        if before.text in (')', ']'):
            return True
        if before.kind != 'name':
            return False
        two = self.tokens[i - 2]
        return not (two.kind == 'name' and two.text not in STATEMENT or two.text in ('>', '&', '*') and not self.spaced(i - 2))

    def is_count(self, i):
        return bool(re.fullmatch(r"\d+u?", self.at(i))) or self.at(i) == 'size' or self.at(i - 2) == 'size'

    def call(self, i):
        """The arguments of a call of the name i, and the call's last token."""
        if self.at(i + 1) != '(':
            return None, None
        last = self.match[i + 1]
        return (self.slice(i + 2, last) if last > i + 2 else None), last

    def name_sites(self, i):
        text = self.at(i)
        scope = self.at(i - 2) if self.at(i - 1) == '::' else None
        args, last = self.call(i)
        first = self.tokens[i - 2].start if scope else self.tokens[i].start
        if args is not None and scope in ('std', 'hn'):
            other = {'min': 'max', 'max': 'min', 'Min': 'Max', 'Max': 'Min'}.get(text) or \
                (LANES.get(text) if scope == 'hn' else None)
            if other:
                kind = 'comparison' if text in LANES else 'minimum or maximum'
                yield Site(kind, first, self.tokens[last].end, f'{scope}::{other}({args})')
        if args is not None and text in BOUND_CALLS and scope in (None, 'OutwardRounding') and \
                self.at(i - 1) not in ('.', '->') and not self.is_declared(i):
            opposite = OPPOSITE.get(text)
            yield Site('bound', first, self.tokens[last].end,
                       f"{'OutwardRounding::' if scope else ''}{opposite}({args})" if opposite else args)
        if BOUND_NAME.match(text) and self.at(i + 1) not in ASSIGN | {'(', '{', '[', '::', '++'} and \
                self.at(i - 1) not in ('.', '->', '[') and self.at(i + 1) != ']' and \
                not (self.at(i - 1) == ',' and self.at(i + 1) in (';', ',')) and not self.is_declared(i):
            whole = text if scope is None else f'{scope}::{text}'
            without = f'{whole} * 0x1p1000' if 'OverflowGuard' in text else \
                f'{whole} - {whole} - {whole}'
            yield Site('bound', first, self.tokens[i].end, without)

    def is_declared(self, i):
        before = self.tokens[i - 1]
        return before.kind == 'name' and before.text not in STATEMENT or \
            before.text in ('>', '&', '*', '&&') and not self.spaced(i - 1) or self.at(i + 1) in ('{',)
