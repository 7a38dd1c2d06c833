"""The rules of the house that a machine can check: who may include whom, what may lie at the top level, how long a file
may be, and what must not be left in one. Each rule takes a Tree and yields sentences that name the file and the line."""

import posixpath
import re
import subprocess
from pathlib import Path

CODE_SUFFIXES = {".cpp", ".h", ".glsl", ".vert", ".frag", ".comp", ".py", ".sh", ".js", ".mjs", ".ts", ".css", ".html"}
TEXT_SUFFIXES = CODE_SUFFIXES | {".md", ".txt", ".json", ".cmake", ".yml", ".yaml", ""}
MAX_LINES = 500

TOP_LEVEL = {
    "CMakeLists.txt", "server", "protocol", "client", "common", "tests", "docker", "README.md",
    "dev", "LICENSE", ".ci", ".clang-format", ".clang-tidy", ".gitignore", "CMakePresets.json",
}

# What a file may include of ours: the first row whose pattern matches its path decides. Patterns match from the start.
# A folder of the server may use those of its own part that stand here, which form no circle (folders_form_no_circle),
# and its own files.
GEOMETRY = ["common/", "server/geometry/"]
VALUES = GEOMETRY + ["server/scene/values/"]
SOLVER = VALUES + [r"server/scene/shading/shading_normals\.h"]
GPU = VALUES + ["server/solver/math/", "server/solver/patches/", "server/solver/rays/", "server/solver/transport/"]
ENGINE = GEOMETRY + [r"server/engine/engine\.h", "server/scene/", "server/solver/", "server/gpu/", "server/state/"]


def among(part, folders, outside):
    """Rows of the folders of a part: each with those folders of it that it may use, and what it may use outside."""
    return [
        (f"server/{part}/{folder}/", outside + [f"server/{part}/{other}/" for other in [folder, *others.split()]])
        for folder, others in folders.items()
    ]


OWN_INCLUDES = [
    ("tests/", ["common/", "protocol/", "server/", "client/", "tests/"]),
    ("common/", ["common/"]),
    ("protocol/", ["common/", "protocol/"]),
    ("server/geometry/", GEOMETRY),
    *among("scene", {
        "values": "",
        "compression": "",
        "document": "compression values",
        "import": "document values",
        "shading": "values",
        "burial": "values",
        "charts": "burial shading values",
        "lightmap": "import document shading values",
    }, GEOMETRY),
    *among("solver", {
        "math": "",
        "patches": "",
        "transport": "math patches",
        "rays": "math patches",
        "error": "patches",
        "lamps": "math patches rays transport",
        "edits": "math patches transport",
        "reflected": "edits lamps math patches rays",
        "variation": "edits lamps math patches rays reflected",
        "surface": "lamps math patches rays",
        "planes": "math patches rays surface",
        "probes": "lamps math patches rays surface",
    }, SOLVER),
    *among("solver", {
        "shooting": "error math patches transport",
        "paper": "lamps math patches transport",
        "links": "math patches shooting transport",
        "repair": "edits lamps links math patches rays transport",
        "pipeline": "edits error lamps links math paper patches rays reflected repair shooting transport variation",
    }, SOLVER + [r"server/solver/\w+\.h"]),
    (r"server/solver/\w+\.h", SOLVER + ["server/solver/error/", "server/solver/lamps/", "server/solver/transport/",
                                        r"server/solver/\w+\.h"]),
    *among("gpu", {
        "gl": "",
        "cull": "gl",
        "draw": "cull gl",
        "gather": "cull draw gl",
        "run": "draw gather gl",
        "workers": "draw gather gl run",
        "picture": "gl",
    }, GPU),
    *among("engine", {
        "lit": "",
        "persist": "lit",
        "publish": "lit",
        "loop": "lit persist publish",
    }, ENGINE),
    ("server/engine/", ["common/"]),
    ("server/state/", ["common/", "server/state/"]),
    ("server/net/", ["common/", "protocol/", "server/net/", r"server/engine/engine\.h", r"server/state/uploads\.h"]),
    (r"server/(main|options|service_notify)[^/]*$", ["common/", "protocol/", "server/"]),
    ("client/lib/", ["common/", "protocol/", "client/lib/"]),
    ("client/engines/", ["common/", "client/engines/"]),
    ("client/cli/", ["common/", "protocol/", "client/lib/", "client/engines/", "client/cli/"]),
]

# What a file of the viewer may import of ours: files of its own folder, and of these. The folders are below VIEWER.
VIEWER = "client/web/src/"
VIEWER_IMPORTS = {
    "": {"app", "page"},
    "app": {"editing", "looking", "protocol", "scenes", "session", "tiles", "ui", "view", "view/light", "view/looks"},
    "editing": {"document", "protocol", "ui", "view", "view/controls"},
    "looking": {"document", "page", "protocol", "ui", "view", "view/controls", "view/looks", "view/rays", "view/scene"},
    "scenes": {"document", "page", "protocol", "textures", "ui", "view", "view/light"},
    "session": {"document", "page", "protocol", "ui", "view", "view/looks"},
    "ui": {"document", "page", "protocol", "view/looks"},
    "tiles": {"protocol", "view/light"},
    "view": {"document", "page", "protocol", "view/controls", "view/exposure", "view/frames", "view/light", "view/looks",
             "view/rays", "view/scene"},
    "view/controls": {"document", "page", "protocol", "view/light", "view/rays", "view/scene"},
    "view/exposure": {"page", "protocol", "view/looks", "view/rays", "view/scene"},
    "view/rays": {"page", "view/light", "view/scene"},
    "view/scene": {"document", "page", "protocol", "view/light", "view/looks"},
    "view/light": {"page", "protocol"},
    "view/frames": set(),
    "view/looks": set(),
    "document": {"protocol"},
    "textures": set(),
    "protocol": set(),
    "page": set(),
}
MAX_METHODS = 40
MAX_MEMBERS = 20

# Libraries that have one home: pattern of the header's name, its name in the message, the folders that may include it.
LIBRARY_HOMES = [
    (r"(GL|EGL|GLES\d?|KHR|epoxy)/", "OpenGL and EGL headers", ["server/gpu/", "tests/"]),
    (r"boost/", "Boost", ["server/net/", r"server/(main|options)[^/]*$", "client/lib/", "tests/"]),
    (r"sqlite3", "SQLite", ["server/state/", "tests/"]),
    (r"openssl/(evp|sha)", "OpenSSL's digests", ["common/"]),
    (r"nlohmann/", "the JSON library", ["protocol/", "server/scene/", "client/cli/", "client/engines/", "client/lib/", "tests/"]),
    (r"tiny_gltf", "the glTF reader", ["server/scene/", "tests/"]),
    (r"webp/", "the WebP decoder", ["server/scene/document/", "tests/"]),
    (r"(draco/|meshoptimizer)", "decoders of compressed geometry", ["server/scene/compression/", "tests/"]),
    (r"(gtest|gmock|benchmark)/", "test libraries", ["tests/"]),
    (r"embree\d/", "the ray tracer", ["server/geometry/", "tests/"]),
]

INCLUDE = re.compile(r'^\s*#\s*include\s*([<"])([^>"]+)[>"]')
# Imports, exports and workers of TypeScript; also those of types alone, and those that are spread over several lines.
IMPORT = re.compile(r"""(?:\b(?:from|import)\s*\(?\s*|\bnew\s+URL\(\s*)(['"])(\.{1,2}/[^'"]+|src/[^'"]+)\1""")
# Of a class as Prettier writes it.
CLASS = re.compile(r"^(?:export )?(?:default )?(?:abstract )?class (\w+)[^{};]*\{\n(.*?)^\}", re.M | re.S)
MODIFIERS = r"(?:(?:public|private|protected|static|override|readonly|abstract|async|declare) )*"
METHOD = re.compile(rf"^  {MODIFIERS}(?:get |set |\*)?(?!constructor\b)[#\w]+(?:<[^\n]*?>)?\(", re.M)
MEMBER = re.compile(rf"^  {MODIFIERS}[#\w]+[?!]?(?: =|:|;)", re.M)
CONSTRUCTOR = re.compile(r"^  constructor\((.*?)\) \{", re.M | re.S)
PARAMETER_MEMBER = re.compile(r"(?:^|[(,\s])(?:(?:public|private|protected|readonly) )+\w+[?:]", re.M)
# Written in pieces, or this file would break its own rule.
LEFTOVER = re.compile(r"\b(" + "|".join(["TO" "DO", "FIX" "ME", "X" "XX", "HA" "CK", "place" "holder", "not " "implemented"]) + r")\b")
# libstdc++ 12 returns or makes std::ranges::subrange in these, whose constraints Clang 14 cannot check.
CLANG_REFUSES = re.compile(
    r"\bstd::(views::|ranges::(views::|subrange\b|(remove|remove_if|unique|partition|stable_partition|rotate|search|search_n"
    r"|equal_range|find_end|shift_left|shift_right)\())"
)
MACHINE_PATH = re.compile(r"(?<![\w.~${}*)\]-])/(work|home|root|Users)/")


class Tree:
    """The files under a folder: those that git knows where the folder is a checkout, else all that are not built."""

    def __init__(self, root):
        self.root = Path(root)
        tracked = self._git("--cached")
        self.top_level_known = tracked is not None
        known = self._git("--cached", "--others", "--exclude-standard")
        self.files = sorted(f for f in (known if known is not None else self._walk()) if (self.root / f).is_file())
        # A user's own stray file at the top level is no fault of the house: only tracked files count there.
        self.top_level = sorted({f.split("/")[0] for f in (tracked if tracked is not None else self.files)})

    def _git(self, *options):
        try:
            done = subprocess.run(["git", "ls-files", "-z", *options], cwd=self.root, capture_output=True, check=True)
        except (OSError, subprocess.CalledProcessError):
            return None
        return [f for f in done.stdout.decode().split("\0") if f]

    def _walk(self):
        skipped = re.compile(r"^(build[^/]*|out|\.git)/|(^|/)(node_modules|__pycache__)/")
        found = (p.relative_to(self.root).as_posix() for p in self.root.rglob("*"))
        return [f for f in found if not skipped.search(f + ("/" if (self.root / f).is_dir() else ""))]

    def code(self):
        return [f for f in self.files if Path(f).suffix in CODE_SUFFIXES or f == "dev"]

    def text(self):
        return [f for f in self.files if Path(f).suffix in TEXT_SUFFIXES and not f.endswith("LICENSE")]

    def lines(self, file):
        text = (self.root / file).read_text(encoding="utf-8", errors="replace")
        return list(enumerate(text.splitlines(), 1))

    def includes(self):
        """(file, line number, header, whether written with quotes) of every include in C++ sources."""
        for file in self.files:
            if Path(file).suffix not in {".cpp", ".h"}:
                continue
            for number, line in self.lines(file):
                match = INCLUDE.match(line)
                if match:
                    yield file, number, match.group(2), match.group(1) == '"'

    def imports(self):
        """(file, line number, the file that it names) of every import of ours in the viewer's sources."""
        for file in self.files:
            if not file.startswith(VIEWER) or not file.endswith(".ts"):
                continue
            text = (self.root / file).read_text(encoding="utf-8")
            for match in IMPORT.finditer(text):
                name = match.group(2)
                base = posixpath.dirname(file) if name.startswith(".") else posixpath.dirname(VIEWER.rstrip("/"))
                target = posixpath.normpath(posixpath.join(base, name))
                if not target.endswith((".ts", ".css")):
                    target += ".ts"
                yield file, text.count("\n", 0, match.start(2)) + 1, target


def matches(path, patterns):
    return any(re.match(pattern, path) for pattern in patterns)


def own_includes_follow_the_arrows(tree):
    ours = re.compile(r"(common|protocol|server|client|tests)/")
    for file, number, header, quoted in tree.includes():
        if header.startswith("."):
            yield f"{file}:{number}: includes {header} by a relative path; write it from the top level"
            continue
        if not ours.match(header):
            if quoted and "/" not in header and (tree.root / file).parent.joinpath(header).exists():
                yield f"{file}:{number}: includes {header} by a relative path; write it from the top level"
            continue
        allowed = next((to for pattern, to in OWN_INCLUDES if re.match(pattern, file)), None)
        if allowed is None:
            yield f"{file}:{number}: no rule says what this file may include; add a row to OWN_INCLUDES"
        elif not matches(header, allowed):
            yield f"{file}:{number}: includes {header}, but may include of ours only {', '.join(allowed)}"


def folders_form_no_circle(tree):
    """Folders of the program that include each other, however far around."""
    uses = {}
    for file, number, header, _ in tree.includes():
        one, other = file.rpartition("/")[0], header.rpartition("/")[0]
        if file.startswith("tests/") or one == other or not (tree.root / header).exists():
            continue
        uses.setdefault(one, {}).setdefault(other, f"{file}:{number}: includes {header}")

    def way(start, end, seen):
        if start == end:
            return []
        for folder, why in uses.get(start, {}).items():
            if folder not in seen:
                seen.add(folder)
                rest = way(folder, end, seen)
                if rest is not None:
                    return [why, *rest]
        return None

    for one, others in uses.items():
        for other, why in others.items():
            back = way(other, one, {other})
            if back is not None:
                yield f"{why}, though {other} uses {one}: {'; '.join(back)}"


def viewer_folder(file):
    return posixpath.dirname(file)[len(VIEWER):]


def viewer_imports_follow_the_arrows(tree):
    for file, number, target in tree.imports():
        folder = viewer_folder(file)
        allowed = VIEWER_IMPORTS.get(folder)
        if allowed is None:
            yield f"{file}:{number}: no rule says what {folder}/ may import; add a row to VIEWER_IMPORTS"
        elif not target.startswith(VIEWER):
            yield f"{file}:{number}: imports {target}, which is no part of the viewer"
        elif viewer_folder(target) not in allowed | {folder}:
            yield f"{file}:{number}: imports {target}, but may import of ours only {', '.join(sorted(allowed)) or 'its own folder'}"


def viewer_imports_make_no_circle(tree):
    """Neither of files nor of folders. Imports of types alone count: whoever reads one file must read the other, too."""
    files, folders = {}, {}
    for file, _, target in tree.imports():
        files.setdefault(file, set()).add(target)
        if viewer_folder(file) != viewer_folder(target):
            folders.setdefault(viewer_folder(file), set()).add(viewer_folder(target))
    for name, graph in ("files", files), ("folders", folders):
        for circle in circles(graph):
            yield f"{VIEWER}: a circle of {name}: {' -> '.join(one or 'main' for one in circle)}"


def circles(graph):
    """One for each place where the way through a graph meets itself again: its nodes, with the first once more at the end."""
    done, way = set(), []

    def visit(node):
        if node in way:
            yield way[way.index(node):] + [node]
        elif node not in done:
            way.append(node)
            for other in sorted(graph.get(node, ())):
                yield from visit(other)
            done.add(way.pop())

    for start in sorted(graph):
        yield from visit(start)


def viewer_classes_are_small(tree):
    for file in tree.files:
        if not file.startswith(VIEWER) or not file.endswith(".ts"):
            continue
        for name, body in CLASS.findall((tree.root / file).read_text(encoding="utf-8")):
            methods = len(METHOD.findall(body))
            parameters = "".join(CONSTRUCTOR.findall(body))
            members = len(MEMBER.findall(body)) + len(PARAMETER_MEMBER.findall(parameters))
            if methods > MAX_METHODS:
                yield f"{file}: {name} has {methods} methods, more than {MAX_METHODS}; it does too much"
            if members > MAX_MEMBERS:
                yield f"{file}: {name} has {members} members, more than {MAX_MEMBERS}; it does too much"


def libraries_stay_at_home(tree):
    for file, number, header, _ in tree.includes():
        for pattern, name, homes in LIBRARY_HOMES:
            if re.match(pattern, header) and not matches(file, homes):
                yield f"{file}:{number}: includes {header}; {name} may appear only in {', '.join(homes)}"


def top_level_is_fixed(tree):
    for entry in tree.top_level:
        if entry not in TOP_LEVEL:
            yield f"{entry}: not one of the top-level entries that the house allows"


def files_are_short(tree):
    for file in tree.code():
        count = len(tree.lines(file))
        if count > MAX_LINES:
            yield f"{file}: {count} lines, more than {MAX_LINES}; split it"


def nothing_is_left_over(tree):
    for file in tree.code():
        for number, line in tree.lines(file):
            if LEFTOVER.search(line):
                yield f"{file}:{number}: left over: {line.strip()}"


def clones_are_made_in_one_way(tree):
    """What chooses between clones of a function does not survive the thread sanitizer; common/clones.h knows of it."""
    for file in tree.files:
        if Path(file).suffix not in {".cpp", ".h"} or file == "common/clones.h":
            continue
        for number, line in tree.lines(file):
            if "target_clones" in line:
                yield f"{file}:{number}: clones of its own; say RADIOSITY_CLONES (common/clones.h)"


def clang_14_can_compile_it(tree):
    for file in tree.files:
        if Path(file).suffix not in {".cpp", ".h"}:
            continue
        for number, line in tree.lines(file):
            if CLANG_REFUSES.search(line.partition("//")[0]):
                yield f"{file}:{number}: Clang 14 refuses this of libstdc++ 12; take the algorithm on iterators: {line.strip()}"


def no_machine_is_named(tree):
    for file in tree.text():
        for number, line in tree.lines(file):
            if MACHINE_PATH.search(line):
                yield f"{file}:{number}: names a path of one machine: {line.strip()}"


def readme_explains_every_package(tree):
    """`dev` installs only what README.md gives a reason for, and README.md lists nothing that `dev` does not install."""
    dev = (tree.root / "dev").read_text(encoding="utf-8")
    installed = set()
    for body in re.findall(r"^\w*packages=\(([^)]*)\)", dev, re.M):
        installed |= set(body.split())
    readme = (tree.root / "README.md").read_text(encoding="utf-8")
    table = readme.partition("\n## Dependencies\n")[2].partition("\n## ")[0]
    first_cells = " ".join(re.findall(r"^\|([^|]*)\|", table, re.M))
    explained = set(re.findall(r"`([^`\s]+)`", first_cells))
    for package in sorted(installed - explained):
        yield f"README.md: Dependencies does not say why {package} is installed"
    for package in sorted(explained - installed):
        yield f"README.md: Dependencies lists {package}, which dev does not install"


RULES = [
    own_includes_follow_the_arrows, folders_form_no_circle, viewer_imports_follow_the_arrows,
    viewer_imports_make_no_circle, viewer_classes_are_small, libraries_stay_at_home, top_level_is_fixed,
    files_are_short, nothing_is_left_over, clones_are_made_in_one_way, clang_14_can_compile_it, no_machine_is_named,
    readme_explains_every_package,
]
