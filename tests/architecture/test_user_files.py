# SPDX-License-Identifier: Apache-2.0
"""Users' files are read by common/input_files.py, which waits for no pipe, and written whole by output_files.py."""

import ast
import pathlib

PACKAGE = pathlib.Path(__file__).resolve().parents[2] / "python/activestereo"
DOORS = {"common/input_files.py", "common/output_files.py"}
# Functions and methods that open what they are given.
OPENERS = {
    "open", "read_text", "read_bytes", "write_text", "write_bytes", "imread", "imwrite", "loadtxt", "savetxt",
    "fromfile", "tofile", "genfromtxt", "memmap", "ZipFile", "copy2", "copyfile", "copytree",
}  # fmt: skip
_ARRAYS = {"load", "save", "savez", "savez_compressed"}
OPENERS_OF = {"np": _ARRAYS, "numpy": _ARRAYS, "json": {"load", "dump"}, "pickle": {"load", "dump"}}
# What is no user's file, or cannot be a pipe.
OTHERS = {
    ("cli/__init__.py", "os.open(os.devnull, os.O_WRONLY)"): "the null device",
    ("cli/depth.py", "np.save(file, depth.astype(np.float32))"): "replace_file()'s",
    ("cli/depth.py", "np.save(file, np.maximum(disparity, 0.0).astype(np.float32))"): "replace_file()'s",
    ("compare/cache.py", "np.savez(content, **arrays)"): "in memory",
    ("effects/engines/loaded_scene.py", "Path('/proc/self/maps').read_text(encoding='utf-8')"): "the kernel's",
    ("effects/engines/loaded_scene.py", "Path(path).read_bytes()"): "the loaded libraries",
    ("diagnose/kept.py", "path.read_bytes()"): "the package's sources",
    ("effects/__init__.py", "file.read_text(encoding='utf-8')"): "the package's",
    ("report/page.py", "resources.files('activestereo.report').joinpath(f'web/{name}').read_text(encoding='utf-8')"):
        "the package's",
}  # fmt: skip
# An opener of this is told an open file, bytes, or a path that was looked at.
LOOKED_AT = ("checked_file(", "io.BytesIO(", "fileobj=")


def opens(source: str) -> list[str]:
    """The calls that open a file by themselves, as they stand."""
    found = []
    for call in (node for node in ast.walk(ast.parse(source)) if isinstance(node, ast.Call)):
        owner = getattr(getattr(call.func, "value", None), "id", "")
        name = getattr(call.func, "id", getattr(call.func, "attr", ""))
        is_function = isinstance(call.func, ast.Name)
        # read_text(path) and write_text(path, ...) are those of the two doors.
        is_door = is_function and name in {"read_text", "read_bytes", "write_text", "write_bytes"}
        if name in OPENERS and not is_door or name in OPENERS_OF.get(owner, ()):
            text = ast.unparse(call)
            if not any(mark in text for mark in LOOKED_AT):
                found.append(text)
    return found


def test_all_files_of_users_go_through_the_two_doors():
    found = {
        (name, call)
        for path in sorted(PACKAGE.rglob("*.py"))
        if (name := str(path.relative_to(PACKAGE))) not in DOORS
        for call in opens(path.read_text())
    }
    assert found - set(OTHERS) == set()
    assert set(OTHERS) - found == set()


def test_an_opener_is_found():
    assert opens("with open(path) as f: pass") == ["open(path)"]
    assert opens("values = json.loads(path.read_text())") == ["path.read_text()"]
    assert opens("a = np.load(path)") == ["np.load(path)"]
    assert opens("a = numpy.load(file, allow_pickle=True)") and opens("open(file, 'rb')") and opens("json.load(data)")
    assert opens("a = read_text(path); b = Image.open(checked_file(path))") == []
