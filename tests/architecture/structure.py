"""Measures of a source tree, read from its text alone: nothing of the package is imported.

A `Package` is a folder of Python files. Each measure is a function of it that returns what it found (names, not only a count), so that a
failing test can say where to look.
"""

from __future__ import annotations

import ast
import io
import re
import tokenize
from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path
from typing import NamedTuple

KERNEL_DECORATORS = frozenset(
    "jit jit_making_arrays jit_with_callbacks inlined inner njit vectorize intrinsic overload overload_method overload_attribute "
    "lower_builtin lower_cast lower_constant type_callable unbox box register_jitable register".split()
)
"""Decorators of functions whose parameters numba types by itself, or calls with arguments of its own (`typeof_impl.register`)."""

_WORD = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+")
Function = ast.FunctionDef | ast.AsyncFunctionDef


@dataclass(frozen=True)
class Module:
    """One file: dotted name, whether it is the `__init__` of a folder, its text and its syntax tree."""

    name: str
    is_folder: bool
    text: str
    tree: ast.Module


@dataclass(frozen=True)
class Package:
    """The modules of a package, by their dotted names (`rigidimpulse.core.memory`)."""

    name: str
    modules: Mapping[str, Module]


class Found(NamedTuple):
    """A function and a number that was measured of it."""

    place: str
    number: int


class OldWord(NamedTuple):
    """A word that must not be used, what replaces it, and the uses that stay.

    Attributes:
        word: lower case; its plural counts as well. Several words (`so many`) are looked for as they stand.
        instead: the field's term.
        allowed: texts in which the word is right: they are taken out before words are counted.
        files: patterns of paths in which the word is right.
        reason: why these uses stay.

    """

    word: str
    instead: str
    allowed: tuple[str, ...] = ()
    files: tuple[str, ...] = ()
    reason: str = ""


def read_package(folder: Path) -> Package:
    """Read all Python files of a package's folder."""
    modules = {}
    for path in sorted(folder.rglob("*.py")):
        parts = (folder.name, *path.relative_to(folder).with_suffix("").parts)
        is_folder = parts[-1] == "__init__"
        name = ".".join(parts[:-1] if is_folder else parts)
        text = path.read_text(encoding="utf-8")
        modules[name] = Module(name, is_folder, text, ast.parse(text, str(path)))
    return Package(folder.name, modules)


def import_graph(package: Package) -> dict[str, set[str]]:
    """Return for each module those modules of the package that it imports: at the top, inside functions, or for types alone.

    `from package.a import b` means the module `package.a.b` where there is one, else `package.a`. Folders on the way do not count, nor does
    `__version__`.
    `import_module("package.a.b")` counts like an import, as long as the name is written out.
    """
    return {name: {other for other in _imports(package, module) if other != name} for name, module in package.modules.items()}


def _imports(package: Package, module: Module) -> Iterator[str]:
    for node in ast.walk(module.tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if alias.name in package.modules)
        elif isinstance(node, ast.ImportFrom):
            base = _imported_from(module, node)
            for alias in node.names:
                inside = f"{base}.{alias.name}"
                if inside in package.modules:
                    yield inside
                elif base in package.modules and alias.name != "__version__":
                    yield base
        elif isinstance(node, ast.Call) and node.args and _last_name(node.func) == "import_module":
            target = node.args[0]
            if isinstance(target, ast.Constant) and target.value in package.modules:
                yield target.value


def _imported_from(module: Module, node: ast.ImportFrom) -> str:
    """Dotted name after `from`; relative ones are resolved."""
    if not node.level:
        return node.module or ""
    parts = module.name.split(".")
    kept = parts[: len(parts) - node.level + module.is_folder]
    return ".".join([*kept, *([node.module] if node.module else [])])


def circles(graph: Mapping[str, Collection[str]]) -> list[list[str]]:
    """Return the strongly connected components of two modules and more, the largest first (Tarjan's algorithm, without recursion)."""
    number: dict[str, int] = {}
    lowest: dict[str, int] = {}
    stack: list[str] = []
    on_stack: set[str] = set()
    found = []
    for root in sorted(graph):
        if root in number:
            continue
        work = [(root, iter(sorted(graph[root])))]
        number[root] = lowest[root] = len(number)
        stack.append(root)
        on_stack.add(root)
        while work:
            node, following = work[-1]
            descended = False
            for other in following:
                if other not in number:
                    number[other] = lowest[other] = len(number)
                    stack.append(other)
                    on_stack.add(other)
                    work.append((other, iter(sorted(graph.get(other, ())))))
                    descended = True
                    break
                if other in on_stack:
                    lowest[node] = min(lowest[node], number[other])
            if descended:
                continue
            work.pop()
            if work:
                lowest[work[-1][0]] = min(lowest[work[-1][0]], lowest[node])
            if lowest[node] == number[node]:
                circle = []
                while not circle or circle[-1] != node:
                    circle.append(stack.pop())
                    on_stack.discard(circle[-1])
                if len(circle) > 1:
                    found.append(sorted(circle))
    return sorted(found, key=lambda circle: (-len(circle), circle))


def layer_of(module: str, layers: Sequence[Collection[str]]) -> int | None:
    """Return the number of a module's layer, from the lowest; None if its folder is in none. `package` itself is the name `""`."""
    below = module.split(".")[1:]
    top = below[0] if below else ""
    return next((k for k, names in enumerate(layers) if top in names), None)


def layer_violations(graph: Mapping[str, Collection[str]], layers: Sequence[Collection[str]]) -> list[tuple[str, str]]:
    """Return pairs (module, module that it imports from a higher layer)."""
    levels = {name: layer_of(name, layers) for name in graph}
    return [
        (name, other)
        for name in sorted(graph)
        for other in sorted(graph[name])
        if (level := levels[name]) is not None and (above := levels[other]) is not None and above > level
    ]


def modules_without_layer(package: Package, layers: Sequence[Collection[str]]) -> list[str]:
    """Return the modules that no layer names."""
    return [name for name in package.modules if layer_of(name, layers) is None]


def functions(module: Module) -> Iterator[tuple[str, Function, bool, bool]]:
    """Yield (name with classes, function, whether its first parameter is self or cls, whether it is a kernel) of a module.

    A function inside a kernel is one as well.
    """

    def inside(node: ast.AST, prefix: str, in_class: bool, in_kernel: bool) -> Iterator[tuple[str, Function, bool, bool]]:
        for child in ast.iter_child_nodes(node):
            if isinstance(child, Function):
                name = f"{prefix}{child.name}"
                decorators = {_last_name(decorator) for decorator in child.decorator_list}
                is_kernel = in_kernel or bool(decorators & KERNEL_DECORATORS)
                yield name, child, in_class and "staticmethod" not in decorators, is_kernel
                yield from inside(child, f"{name}.", False, is_kernel)
            elif isinstance(child, ast.ClassDef):
                yield from inside(child, f"{prefix}{child.name}.", True, in_kernel)
            else:
                yield from inside(child, prefix, in_class, in_kernel)

    yield from inside(module.tree, f"{module.name}.", False, False)


def _last_name(node: ast.AST) -> str:
    """Return `c` of `c`, `a.b.c`, and of calls of them."""
    while isinstance(node, ast.Call):
        node = node.func
    return node.attr if isinstance(node, ast.Attribute) else node.id if isinstance(node, ast.Name) else ""


def parameters(function: Function, is_method: bool) -> list[ast.arg]:
    """Return a function's parameters, without self or cls; `*args` and `**kwargs` are one each."""
    given = function.args
    ordered = [*given.posonlyargs, *given.args]
    rest = [argument for argument in (given.vararg, given.kwarg) if argument is not None]
    return [*ordered[1 if is_method else 0 :], *given.kwonlyargs, *rest]


def parameter_counts(package: Package) -> list[Found]:
    """Return the number of parameters of each function, the most first."""
    counts = [
        Found(name, len(parameters(function, is_method)))
        for module in package.modules.values()
        for name, function, is_method, _ in functions(module)
    ]
    return sorted(counts, key=lambda found: (-found.number, found.place))


def untyped_parameters(package: Package) -> list[str]:
    """Return the parameters outside kernels that have no type."""
    return [
        f"{name}({argument.arg})"
        for module in package.modules.values()
        for name, function, is_method, is_kernel in functions(module)
        if not is_kernel
        for argument in parameters(function, is_method)
        if argument.annotation is None
    ]


def parameters_called(package: Package, word: str) -> list[str]:
    """Return the functions outside kernels with a parameter of this name (numba calls its intrinsics with a `context`)."""
    return [
        name
        for module in package.modules.values()
        for name, function, is_method, is_kernel in functions(module)
        if not is_kernel and any(argument.arg == word for argument in parameters(function, is_method))
    ]


def comment_lines(package: Package) -> int:
    """Return the number of lines inside functions that have a comment for people."""
    count = 0
    for module in package.modules.values():
        inside: set[int] = set()
        for _, function, _, _ in functions(module):
            inside.update(range(function.lineno, (function.end_lineno or 0) + 1))
        count += len(inside & _comment_lines(module.text))
    return count


def _comment_lines(text: str) -> set[int]:
    """Numbers of the lines with a comment for people."""
    return {
        token.start[0]
        for token in tokenize.generate_tokens(io.StringIO(text).readline)
        if token.type == tokenize.COMMENT and not token.string.lstrip("# ").startswith(("fmt:", "noqa", "type:", "pyright:", "pragma"))
    }


def size(package: Package) -> tuple[int, int]:
    """Return (files, lines) of a package."""
    return len(package.modules), sum(len(module.text.splitlines()) for module in package.modules.values())


def words_of(text: str) -> list[str]:
    """Return the words of a text in lower case: identifiers are taken apart at underscores and at capitals (`heapSize`, `HEAP_SIZE`)."""
    return [word.lower() for word in _WORD.findall(text)]


def count_old_words(path: str, text: str, old_words: Sequence[OldWord]) -> dict[str, int]:
    """Return how often each old word stands in a text, where it is not allowed; path: of the file, for its exceptions."""
    found: dict[str, int] = {}
    words = words_of(text)
    counts, joined = Counter(words), f" {' '.join(words)} "
    for entry in old_words:
        if any(fnmatchcase(path, pattern) for pattern in entry.files):
            continue
        if " " in entry.word:
            number = joined.count(f" {entry.word} ")
        else:
            forms = (entry.word, f"{entry.word}s", f"{entry.word}es")
            if number := sum(counts[form] for form in forms):
                kept = text
                for allowed in entry.allowed:
                    kept = kept.replace(allowed, " ")
                number = sum(word in forms for word in words_of(kept)) if entry.allowed else number
        if number:
            found[entry.word] = number
    return found


def old_words_in(root: Path, patterns: Sequence[str], old_words: Sequence[OldWord]) -> dict[str, dict[str, int]]:
    """Return {path: {word: count}} of the files below a folder that match any of the patterns."""
    found = {}
    for path in sorted({path for pattern in patterns for path in root.glob(pattern) if path.is_file()}):
        name = path.relative_to(root).as_posix()
        counts = count_old_words(name, path.read_text(encoding="utf-8"), old_words)
        counts_of_name = count_old_words(name, name, old_words)
        for word, number in counts_of_name.items():
            counts[word] = counts.get(word, 0) + number
        if counts:
            found[name] = counts
    return found
