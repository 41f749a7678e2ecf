# SPDX-License-Identifier: Apache-2.0
"""The documentation site can be built, and every link on it leads to a page and a heading that are there."""

import importlib
import os
import pathlib
import shutil
import subprocess
from html.parser import HTMLParser
from urllib.parse import unquote

import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
BUILD = pathlib.Path(os.environ.get("ACTIVESTEREO_BUILD", ROOT / "build")).resolve()


class Page(HTMLParser):
    """Where a page leads to, and the names of its places."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.links: list[str] = []
        self.places: set[str] = set()
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        for name, value in attrs:
            if value and name in ("href", "src"):
                self.links.append(unquote(value))
            if value and name in ("id", "name"):
                self.places.add(value)


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> pathlib.Path:
    missing = [name for name in ("doxygen", "mkdocs") if shutil.which(name) is None]
    missing += [path.name for path in [pathlib.Path("/usr/share/mkdocs/themes/material")] if not path.is_dir()]
    if missing:
        pytest.skip(f"{', '.join(missing)} not installed: tests/docs.sh installs what the site needs")
    folder = tmp_path_factory.mktemp("docs")
    variables = os.environ | {"ACTIVESTEREO_BUILD": str(BUILD)}
    said = subprocess.run(
        ["bash", str(ROOT / "tests/docs.sh"), str(folder)], env=variables, capture_output=True, text=True
    )
    assert said.returncode == 0, said.stdout + said.stderr
    return folder / "site"


def test_every_link_leads_somewhere(site: pathlib.Path) -> None:
    pages = {path: Page(path.read_text()) for path in site.rglob("*.html") if "include/html" not in path.as_posix()}
    assert len(pages) > 20
    lost = []
    for path, page in pages.items():
        for link in page.links:
            address, _, place = link.partition("#")
            if "://" in address or address.startswith(("mailto:", "data:", "/")):
                continue
            target = (path.parent / address).resolve() if address else path
            target = target / "index.html" if target.is_dir() else target
            if not target.exists() or (place and target in pages and place not in pages[target].places):
                lost.append(f"{path.relative_to(site)}: {link}")
    assert not lost


def test_the_references_have_what_programs_call(site: pathlib.Path) -> None:
    headers = "".join(path.read_text() for path in site.glob("capi/include/html/*8h.html"))
    assert "kuafu_renderer_render" in headers
    assert "simsense_engine_compute" in headers
    python = (site / "examples/guide/python_api.html").read_text()
    for name in ("take_picture", "compute_depth", "get_pointcloud"):
        assert name in python
    main_page = (site / "capi/include/html/index.html").read_text()
    assert "kuafu_renderer_render" in main_page and "simsense_engine_compute" in main_page
    assert "<table" in main_page and "|---|" not in main_page and "**" not in main_page


@pytest.mark.parametrize("module", ["kuafu", "simsense"])
def test_the_reference_has_every_member_of_the_bindings(module: str, site: pathlib.Path) -> None:
    page = (site / "examples/guide/python_api.html").read_text()
    bindings = importlib.import_module(f"{module}._{module}")
    for name, kind in vars(bindings).items():
        if isinstance(kind, type) and kind.__module__ == bindings.__name__:
            _, _, section = page.partition(f'id="{module}{name.lower()}"')
            section = section.partition("<h3")[0]
            missing = [member for member in vars(kind) if not member.startswith("_") and member not in section]
            assert section and not missing, (name, missing)
