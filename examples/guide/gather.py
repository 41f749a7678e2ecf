#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Gathers the pages of the documentation site from the repository: gather.py FOLDER writes FOLDER/pages and
FOLDER/mkdocs.yml.

The pages keep their places, so that links between them stay as they are; the files that they show or link to are copied
beside them. Three directives, each alone on a line, include what other files say: `<!-- site: section PAGE "Heading"
-->` the text under a heading, `<!-- site: program FILE -->` a file as a code block, and `<!-- site: stubs FILE.pyi -->`
every class of type stubs with every member.
"""

import ast
import pathlib
import re
import shutil
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]
CONFIG = pathlib.Path(__file__).with_name("mkdocs.yml")
LANGUAGES = {".c": "c", ".cpp": "cpp", ".json": "json", ".py": "python", ".rs": "rust", ".txt": "cmake"}
LINK = re.compile(r"(?P<text>\[(?:[^\[\]]|\[[^\]]*\](?:\([^)]*\))?)*\])\((?P<path>[^)#\s]*)(?P<anchor>#[^)\s]*)?\)")
FENCE = re.compile(r"^```.*?^```", re.DOTALL | re.MULTILINE)
# Doxygen writes this folder after the pages have been gathered.
MADE_LATER = ROOT / "capi/include/html"


class PageError(Exception):
    """A page names something that is not there."""


def page_names(config: str) -> list[str]:
    """The pages that mkdocs.yml lists, as paths from the repository's root."""
    return re.findall(r"^\s*- (?:[^:\n]*: )?([\w./]+\.md)$", config, re.MULTILINE)


def section(page: pathlib.Path, heading: str) -> str:
    """The text under a heading, to the next one of its level or above."""
    found = re.search(
        rf"^(#+) {re.escape(heading)}\n(.*?)(?=^#{{1,2}} |\Z)", page.read_text(), re.DOTALL | re.MULTILINE
    )
    if not found:
        raise PageError(f"{page.relative_to(ROOT)} has no heading '{heading}'")
    return found.group(2).strip()


def stubs(path: pathlib.Path) -> str:
    """Headings of the classes of a stub file, with their docstrings and a line for each public member."""
    module, parts = path.stem.lstrip("_"), []
    for node in ast.parse(path.read_text()).body:
        if isinstance(node, ast.ClassDef):
            parts += [f"### {module}.{node.name}", " ".join((ast.get_docstring(node) or "").split()), _members(node)]
    return "\n\n".join(part for part in parts if part)


def _members(node: ast.ClassDef) -> str:
    """A line for each member: its call or type, and its docstring; a setter says nothing that its getter does not."""
    lines = {}
    for member, after in zip(node.body, [*node.body[1:], None], strict=True):
        if isinstance(member, ast.AnnAssign):
            name, shown = ast.unparse(member.target), ast.unparse(member)
            is_said = isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant)
            said = " ".join(str(after.value.value).split()) if is_said else ""
        elif isinstance(member, ast.FunctionDef) and (not member.name.startswith("_") or member.name == "__init__"):
            name, said = member.name, " ".join((ast.get_docstring(member) or "").split())
            decorators = [ast.unparse(decorator) for decorator in member.decorator_list]
            returned = f" -> {ast.unparse(member.returns)}" if member.returns else ""
            parameters = re.sub(r"^self(, )?", "", ast.unparse(member.args))
            shown = name + ("" if "property" in decorators else f"({parameters})") + returned
        else:
            continue
        lines.setdefault(name, f"- `{shown}`" + (f": {said}" if said else ""))
    return "\n".join(lines.values())


def moved_links(text: str, old: pathlib.Path, new: pathlib.Path) -> str:
    """Links of text that stood in a page of folder old, for a page of folder new."""

    def moved(match: re.Match[str]) -> str:
        path = match["path"]
        if not path or "://" in path:
            return match[0]
        up = len(new.relative_to(ROOT).parts)
        target = (old / path).resolve().relative_to(ROOT).as_posix()
        return f"{match['text']}({'../' * up}{target}{match['anchor'] or ''})"

    return LINK.sub(moved, text)


def with_includes(page: pathlib.Path) -> str:
    """A page's text with its directives carried out."""

    def included(match: re.Match[str]) -> str:
        path = page.parent / match["path"]
        if not path.is_file():
            raise PageError(f"{page.relative_to(ROOT)} includes {match['path']}, which is not there")
        if match["kind"] == "stubs":
            return stubs(path)
        if match["kind"] == "program":
            return f"```{LANGUAGES[path.suffix]}\n{path.read_text()}```"
        return moved_links(section(path, match["heading"]), path.parent, page.parent)

    pattern = r'^<!-- site: (?P<kind>section|program|stubs) (?P<path>\S+)(?: "(?P<heading>[^"]+)")? -->$'
    return re.sub(pattern, included, page.read_text(), flags=re.MULTILINE)


def gather(names: list[str], target: pathlib.Path) -> None:
    """Copies the pages of these names, and what they link to, into the folder `target`."""
    pages = {ROOT / name for name in names}
    for page in sorted(pages):
        if not page.is_file():
            raise PageError(f"mkdocs.yml names {page.relative_to(ROOT)}, which is not there")
        text = with_includes(page)
        blocks = [match.span() for match in FENCE.finditer(text)]

        def moved(match: re.Match[str], page: pathlib.Path = page, blocks: list[tuple[int, int]] = blocks) -> str:
            in_block = any(start <= match.start() < end for start, end in blocks)
            return match[0] if in_block else site_link(match, page, pages, target)

        path = target / page.relative_to(ROOT)
        path.parent.mkdir(parents=True, exist_ok=True)
        # A link's text may itself hold a picture with a link of its own.
        path.write_text(LINK.sub(moved, text))


def site_link(match: re.Match[str], page: pathlib.Path, pages: set[pathlib.Path], target: pathlib.Path) -> str:
    """The link as the site has it: to a page, to a copied file, or plain text where it leads to a folder without a
    page."""
    text, path, anchor = match["text"], match["path"], match["anchor"] or ""
    there = (page.parent / path).resolve()
    if not path or "://" in path or there.is_relative_to(MADE_LATER):
        return match[0]
    if not there.exists():
        raise PageError(f"{page.relative_to(ROOT)} links to {path}, which is not there")
    if there.is_dir():
        is_page = there / "README.md" in pages
        return f"{text}({path.rstrip('/')}/README.md{anchor})" if is_page else text[1:-1]
    if there in pages:
        return match[0]
    if there.suffix == ".md":
        return text[1:-1]
    copy = target / there.relative_to(ROOT)
    copy.parent.mkdir(parents=True, exist_ok=True)
    shutil.copy(there, copy)
    return match[0]


def main() -> int:
    """0: gathered. 1: a page names something that is not there."""
    folder = pathlib.Path(sys.argv[1])
    config = CONFIG.read_text()
    shutil.rmtree(folder / "pages", ignore_errors=True)
    folder.mkdir(parents=True, exist_ok=True)
    try:
        gather(page_names(config), folder / "pages")
    except PageError as error:
        print(error, file=sys.stderr)
        return 1
    (folder / "mkdocs.yml").write_text(config)
    return 0


if __name__ == "__main__":
    sys.exit(main())
