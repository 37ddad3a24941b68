"""What can be changed in a C++ file, one small thing at a time, and the file with all of that behind switches. Part of tools/mutate."""
import bisect
import collections
import hashlib
import json
import pathlib
import re
import sys

sys.path.append("/usr/lib/python3/dist-packages")  # Debian's python3-clang-16, whichever Python runs
from clang import cindex  # noqa: E402
from clang.cindex import CursorKind as K  # noqa: E402

ROOT = pathlib.Path(__file__).resolve().parent.parent
OUT = ROOT / "build/mutate"
LIBCLANG = "/usr/lib/llvm-16/lib/libclang.so.1"

COMPARE = {"<": ["<=", ">="], "<=": ["<", ">"], ">": [">=", "<="], ">=": [">", "<"], "==": ["!="], "!=": ["=="]}
ARITHMETIC = {"+": "-", "-": "+", "*": "/", "/": "*", "%": "*", "<<": ">>", ">>": "<<", "&": "|", "|": "&", "^": "&"}
ASSIGN = {"+=": "-=", "-=": "+=", "*=": "/=", "/=": "*=", "<<=": ">>=", ">>=": "<<=", "|=": "&=", "&=": "|="}

SWITCH = r"""// What tools/mutate compiles into what it changes.
#ifndef VOXELD_MUTANT_SWITCH_H_
#define VOXELD_MUTANT_SWITCH_H_
#include <fcntl.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <unistd.h>
#include <type_traits>
namespace voxeld_mutant {
struct Switch {
  int active = -1;
  unsigned char* reached = nullptr;
  Switch() {
    if (const char* number = getenv("MUTANT")) active = atoi(number);
    const char* path = getenv("MUTANT_REACHED");
    const char* size = getenv("MUTANT_COUNT");
    if (path == nullptr || size == nullptr) return;
    const int file = open(path, O_RDWR | O_CLOEXEC);
    if (file < 0) return;
    void* memory = mmap(nullptr, atoi(size), PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
    close(file);
    if (memory != MAP_FAILED) reached = static_cast<unsigned char*>(memory);
  }
};
inline const Switch kSwitch;
inline bool Active(int number) {
  if (kSwitch.reached != nullptr) kSwitch.reached[number] = 1;
  return kSwitch.active == number;
}
constexpr bool Is(int number) {
  if (std::is_constant_evaluated()) return false;
  return Active(number);
}
}  // namespace voxeld_mutant
#endif
"""


def blank(text):
    """The text with comments, and the insides of strings and characters, as spaces."""
    def spaces(match):
        return re.sub(r"[^\n]", " ", match[0])
    return re.sub(r'//[^\n]*|/\*.*?\*/|R"\(.*?\)"|"(?:\\.|[^"\\\n])*"|(?<![0-9A-Fa-f])\'(?:\\.|[^\'\\\n])+\'', spaces, text, flags=re.DOTALL)


def one_line(text):
    """An expression's text without comments and line ends, so that what is changed stands in the lines where it stood."""
    bare = re.sub(r'("(?:\\.|[^"\\\n])*")|//[^\n]*|/\*.*?\*/', lambda m: m[1] or " ", text, flags=re.DOTALL)
    return re.sub(r"\s*\n\s*", " ", bare).strip()


Site = collections.namedtuple("Site", "start end kind alternatives")


class Finder:
    """Walks one file's syntax tree; `sites` are what can be changed."""

    def __init__(self, path, unit, text):
        self.path, self.text, self.blanked = str(path), text, blank(text)
        # Offsets of libclang count bytes.
        self.bytes = text.encode()
        self.sites = []
        self.macros = []
        for cursor in unit.cursor.get_children():
            if cursor.location.file is None or cursor.location.file.name != self.path:
                continue
            if cursor.kind == K.MACRO_INSTANTIATION:
                self.macros.append((cursor.extent.start.offset, cursor.extent.end.offset))
        for cursor in unit.cursor.get_children():
            if cursor.location.file is not None and cursor.location.file.name == self.path and cursor.kind.is_declaration():
                self.walk(cursor, [])
        covered = {(s.start, s.end) for s in self.sites if s.kind in ("comparison", "negation")}
        self.sites = [s for s in self.sites if s.kind != "condition" or (s.start, s.end) not in covered]

    def span(self, cursor):
        begin, end = cursor.extent.start, cursor.extent.end
        if begin.file is None or end.file is None or begin.file.name != self.path or end.file.name != self.path:
            return None
        start, stop = begin.offset, end.offset
        if start >= stop or any(a <= start < b or a < stop < b for a, b in self.macros):
            return None
        return start, stop

    def source(self, start, stop):
        return self.bytes[start:stop].decode()

    def add(self, span, kind, alternatives):
        if span is not None and alternatives:
            self.sites.append(Site(*span, kind, tuple(alternatives)))

    def between(self, left, right):
        """The operator between two operands."""
        middle = self.bytes[left[1]:right[0]].decode()
        return re.sub(r"//[^\n]*|/\*.*?\*/", "", middle, flags=re.DOTALL).strip()

    def walk(self, cursor, parents):
        try:
            kind = cursor.kind
        except ValueError:
            return  # newer than the bindings: what a template requires, which the compiler decides
        if kind in (K.STATIC_ASSERT, K.MACRO_INSTANTIATION, K.ENUM_DECL, K.ALIAS_DECLARATION if hasattr(K, "ALIAS_DECLARATION") else K.TYPEDEF_DECL):
            return
        if kind == K.VAR_DECL:
            span = self.span(cursor)
            if span is None or re.match(r"(static\s+|inline\s+)*constexpr\b", self.source(*span)):
                return
        children = list(cursor.get_children())
        handler = {K.BINARY_OPERATOR: self.binary, K.COMPOUND_ASSIGNMENT_OPERATOR: self.assignment, K.UNARY_OPERATOR: self.unary,
                   K.IF_STMT: self.condition, K.WHILE_STMT: self.condition, K.CONDITIONAL_OPERATOR: self.choice,
                   K.INTEGER_LITERAL: self.number, K.FLOATING_LITERAL: self.number, K.CXX_BOOL_LITERAL_EXPR: self.truth,
                   K.CALL_EXPR: self.call, K.RETURN_STMT: self.leaving, K.BREAK_STMT: self.leaving, K.CONTINUE_STMT: self.leaving}.get(kind)
        if handler:
            handler(cursor, children, parents)
        if parents and kind.is_expression():
            self.statement(cursor, parents)
        for index, child in enumerate(children):
            if kind == K.CASE_STMT and index == 0:
                continue  # the label
            self.walk(child, parents + [cursor])

    def binary(self, cursor, children, parents):
        span = self.span(cursor)
        if span is None or len(children) != 2:
            return
        left, right = self.span(children[0]), self.span(children[1])
        if left is None or right is None:
            return
        operator = self.between(left, right)
        a, b = one_line(self.source(*left)), one_line(self.source(*right))
        if operator in COMPARE:
            self.add(span, "comparison", [f"{a} {o} {b}" for o in COMPARE[operator]])
        elif operator in ("&&", "||"):
            self.add(span, "side left out", [f"bool({a})", f"bool({b})"])
        elif operator in ARITHMETIC and "pointer" not in str(cursor.type.kind).lower():
            self.add(span, "arithmetic", [f"{a} {ARITHMETIC[operator]} {b}"])

    def assignment(self, cursor, children, parents):
        span = self.span(cursor)
        if span is None or len(children) != 2:
            return
        left, right = self.span(children[0]), self.span(children[1])
        if left is None or right is None:
            return
        operator = self.between(left, right)
        if operator in ASSIGN:
            self.add(span, "arithmetic", [f"{one_line(self.source(*left))} {ASSIGN[operator]} {one_line(self.source(*right))}"])

    def unary(self, cursor, children, parents):
        span = self.span(cursor)
        if span is None:
            return
        text = self.source(*span)
        if text.startswith("!"):
            self.add(span, "negation", [f"!!({one_line(text[1:])})"])
        elif text.startswith("-") and not text.startswith("--"):
            self.add(span, "negation", [one_line(text[1:])])

    def condition(self, cursor, children, parents):
        span = self.span(cursor)
        if span is None:
            return
        flat = blank(self.source(*span))
        head = re.match(r"(if|while)\s*(constexpr)?\s*\(", flat)
        if head is None or head[2]:
            return
        depth, end = 1, head.end()
        while depth > 0 and end < len(flat):
            depth += {"(": 1, ")": -1}.get(flat[end], 0)
            end += 1
        inside = len(self.source(*span)[:end - 1].encode()) + span[0]
        found = [s for c in children if c.kind.is_expression() and (s := self.span(c)) is not None and s[1] <= inside]
        declared = [s for c in children if c.kind in (K.DECL_STMT, K.VAR_DECL) and (s := self.span(c)) is not None]
        if found and not any(a <= found[-1][0] < b for a, b in declared):
            self.turn_round(found[-1])

    def choice(self, cursor, children, parents):
        if len(children) == 3 and (span := self.span(children[0])) is not None:
            self.turn_round(span)

    def turn_round(self, span):
        """A condition, but for those that turn round as comparisons or by their own `!`."""
        self.add(span, "condition", [f"!({one_line(self.source(*span))})"])

    def number(self, cursor, children, parents):
        span = self.span(cursor)
        if span is None:
            return
        text = self.source(*span)
        if match := re.fullmatch(r"(0[xX][0-9a-fA-F']+|[0-9']+)([uUlLzZ]*)", text):
            compared = ""
            if parents and parents[-1].kind == K.BINARY_OPERATOR:
                spans = [self.span(c) for c in parents[-1].get_children()]
                if len(spans) == 2 and None not in spans:
                    compared = self.between(*spans)
            if compared in ("<", "<=", ">", ">="):
                return  # moved by one as a comparison
            value = int(match[1].replace("'", ""), 0) if not re.fullmatch(r"0[0-7']+", match[1]) else int(match[1].replace("'", ""), 8)
            self.add(span, "number", [f"{value + 1}{match[2]}"] + ([f"{value - 1}{match[2]}"] if value > 0 and compared not in ("==", "!=") else []))
        elif re.fullmatch(r"[0-9.]+[fF]?", text):
            self.add(span, "number", [f"({text} + 1)"])

    def truth(self, cursor, children, parents):
        if (span := self.span(cursor)) is not None:
            self.add(span, "truth", ["false" if self.source(*span) == "true" else "true"])

    def call(self, cursor, children, parents):
        if cursor.spelling in ("operator==", "operator!=", "operator<", "operator>", "operator<=", "operator>=") and cursor.type.spelling == "bool":
            if (span := self.span(cursor)) is not None:
                self.add(span, "comparison", [f"!({one_line(self.source(*span))})"])

    def ended(self, span):
        """Up to and with the semicolon."""
        stop = span[1]
        while stop < len(self.bytes) and chr(self.bytes[stop]).isspace():
            stop += 1
        return (span[0], stop + 1) if stop < len(self.bytes) and self.bytes[stop:stop + 1] == b";" else None

    def statement(self, cursor, parents):
        parent = parents[-1].kind
        if parent not in (K.COMPOUND_STMT, K.IF_STMT, K.FOR_STMT, K.WHILE_STMT, K.CXX_FOR_RANGE_STMT, K.CASE_STMT, K.DEFAULT_STMT):
            return
        span = self.span(cursor)
        if span is None or (span := self.ended(span)) is None:
            return
        before = self.blanked.encode()[:span[0]].rstrip()
        if not before.endswith((b"{", b"}", b";", b")", b":", b"else")) or before.endswith(b"for (") or re.search(rb"for\s*\([^;{}]*;[^;{}]*;?$", before):
            return
        if before.endswith(b";") and parent in (K.FOR_STMT, K.IF_STMT):
            return
        self.add(span, "statement left out", [""])

    def leaving(self, cursor, children, parents):
        kinds = [p.kind for p in parents]
        for index in range(len(kinds) - 1, -1, -1):
            if kinds[index] in (K.LAMBDA_EXPR, K.FUNCTION_DECL, K.CXX_METHOD, K.FUNCTION_TEMPLATE, K.CONSTRUCTOR):
                kinds = kinds[index + 1:]
                inner = parents[index + 1:]
                break
        else:
            return
        if cursor.kind == K.BREAK_STMT:
            loops = [k for k in kinds if k in (K.SWITCH_STMT, K.FOR_STMT, K.WHILE_STMT, K.CXX_FOR_RANGE_STMT, K.DO_STMT)]
            if not loops or loops[-1] != K.SWITCH_STMT:
                if K.IF_STMT not in kinds:
                    return
        decided = K.IF_STMT in kinds
        if not decided and K.CASE_STMT in kinds:
            # Into the next case, if there is one.
            switch = inner[max(i for i, k in enumerate(kinds) if k == K.SWITCH_STMT)] if K.SWITCH_STMT in kinds else None
            decided = switch is not None and cursor.extent.end.offset < switch.extent.end.offset - 1 and \
                re.search(rb"\b(case|default)\b", self.bytes[cursor.extent.end.offset:switch.extent.end.offset]) is not None
        if not decided:
            return
        span = self.span(cursor)
        if span is not None and (span := self.ended(span)) is not None:
            self.add(span, "leaving left out", [""])


def find_sites(job):
    path, arguments = job
    if not cindex.Config.loaded:
        cindex.Config.set_library_file(LIBCLANG)
    text = (ROOT / path).read_text()
    # Parsing takes longest, for what is included: what was found is kept for as long as file and tool are the same.
    digest = hashlib.sha256("\0".join([text, pathlib.Path(__file__).read_text(), *arguments]).encode()).hexdigest()
    kept = OUT / "sites" / f"{digest}.json"
    if kept.exists():
        return path, [Site(start, end, kind, tuple(alternatives)) for start, end, kind, alternatives in json.loads(kept.read_text())]
    unit = cindex.Index.create().parse(str(ROOT / path), args=arguments, options=cindex.TranslationUnit.PARSE_DETAILED_PROCESSING_RECORD)
    errors = [str(d) for d in unit.diagnostics if d.severity >= cindex.Diagnostic.Error]
    if errors:
        raise RuntimeError(f"{path}: {errors[0]}")
    finder = Finder(ROOT / path, unit, text)
    unique = {}
    for site in finder.sites:
        unique.setdefault((site.start, site.end, site.kind), site)
    # Outer before inner; of one extent what is wholly replaced last.
    found = sorted(unique.values(), key=lambda s: (s.start, -s.end, s.kind not in ("statement left out", "leaving left out"), s.kind != "condition"))
    kept.parent.mkdir(parents=True, exist_ok=True)
    kept.write_text(json.dumps(found))
    return path, found


class Mutant:
    def __init__(self, number, path, line, kind, was, becomes):
        self.number, self.path, self.line, self.kind, self.was, self.becomes = number, path, line, kind, was, becomes

    def facts(self):
        return {"id": self.number, "file": self.path, "line": self.line, "kind": self.kind, "was": self.was, "is": self.becomes}


def render(path, sites, numbers, dropped):
    """The file with every mutant but `dropped` behind its switch."""
    data = (ROOT / path).read_bytes()

    def wrap(site, inner):
        ids = [(n, alt) for n, alt in zip(numbers[site], site.alternatives) if n not in dropped]
        if not ids:
            return inner
        if site.kind.endswith("left out") and site.kind != "side left out":
            return f"{{ if (!::voxeld_mutant::Is({ids[0][0]})) {inner} }}"
        keep = f"!!({inner})" if site.kind == "condition" else f"({inner})"
        for number, alternative in ids:
            keep = f"(::voxeld_mutant::Is({number}) ? ({alternative}) : {keep})"
        return keep

    def text(start, end, inside):
        out, at, index = [], start, 0
        while index < len(inside):
            site = inside[index]
            out.append(data[at:site.start].decode())
            nested = []
            index += 1
            while index < len(inside) and inside[index].start < site.end:
                nested.append(inside[index])
                index += 1
            out.append(wrap(site, text(site.start, site.end, nested)))
            at = site.end
        out.append(data[at:end].decode())
        return "".join(out)

    return f'#include "{OUT}/switch.h" // ' + "\n#line 1\n" + text(0, len(data), sites)


def line_starts(path):
    data = (ROOT / path).read_bytes()
    return [0] + [i + 1 for i, c in enumerate(data) if c == 10]


def line_of(starts, offset):
    return bisect.bisect_right(starts, offset)
