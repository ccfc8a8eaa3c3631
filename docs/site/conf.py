"""Sphinx's configuration: the pages as they are, in the order in which docs/README.md lists them.

The source folder is the repository's root, so that links work here as they do in a checkout.
"""

import re
import sys
from importlib.metadata import version as installed
from pathlib import Path

from sphinx.application import Sphinx

HERE = Path(__file__).parent
ROOT = HERE.parent.parent
sys.path.insert(0, str(HERE))
import reference  # noqa: E402

project = "formup"
html_title = f"formup {installed('formup')}"
language = "en"
extensions = ["myst_parser", "sphinx.ext.autodoc"]
root_doc = "docs/README"
include_patterns = [
    *("*.md", "docs/*.md", "docs/reference/**.md", "examples/*.md"),
    *("evals/photos/*.md", "vendor/vda5050/*.md"),
]
# Sphinx follows links, and .venv holds one to the root: it must not be searched.
exclude_patterns = [
    folder.name
    for folder in ROOT.iterdir()
    if folder.is_dir() and folder.name not in {"docs", "examples", "evals", "vendor"}
]

myst_heading_anchors = 4
smartquotes = False  # two hyphens begin an option
highlight_language = "none"
default_role = "literal"  # docstrings write `code` with one backtick
autodoc_member_order = "bysource"
autodoc_preserve_defaults = True
autodoc_typehints_format = "short"
python_maximum_signature_line_length = 80
python_use_unqualified_type_names = True
nitpicky = True
# Types of other libraries lead nowhere: a build asks no other site for their addresses.
nitpick_ignore_regex = [("py:.*", ".*")]

html_theme = "furo"
html_static_path = ["static"]
html_css_files = ["site.css"]
html_js_files = ["site.js"]
html_show_sourcelink = html_copy_source = html_show_copyright = False

SECTION = re.compile(r"^## (.+)$", re.MULTILINE)
ENTRY = re.compile(r"^- \[([^]]+)\]\(([^)#:]+)\.md\)", re.MULTILINE)
LINK = re.compile(r"\[([^]]+)\]\(([^)#:\s]+)\)")
MENDED = {
    '<aside class="sidebar-drawer">': '<aside class="sidebar-drawer" aria-label="All pages">',
    '<aside class="toc-drawer': '<aside aria-label="On this page" class="toc-drawer',
    '<p class="caption" role="heading">': '<p class="caption" role="heading" aria-level="2">',
    'Variables<span class="colon">': 'Attributes<span class="colon">',
    '<th class="head"><p></p></th>': "<td></td>",
    '<div id="search-results">': '<h1>Search</h1>\n<div class="found" id="search-results">',
}
"""Replacements in the HTML of the theme, which lacks some of what screen readers need."""
SIGNATURE = re.compile(r"<dl>\n(<dd><em class=\"sig-param\">.*?)</dl>", re.DOTALL)
"""A signature with a line for each parameter: a list of definitions without terms."""
DASH = re.compile(r"(<p>(?:<[^>]*>)*[\w.]+(?:</[^>]*>)*(?: \(.*\))?) -- ")
"""The two hyphens between a parameter and its description."""
FORWARD = """<!doctype html>
<html lang="en">
<meta charset="utf-8">
<title>formup</title>
<meta http-equiv="refresh" content="0; url=docs/README.html">
<p><a href="docs/README.html">formup's documentation</a></p>
</html>
"""


def toctree(options: str, entries: list[tuple[str, str]]) -> str:
    """A directive that adds pages, as (title, path), to the navigation."""
    lines = "\n".join(f"{words} <{target}>" for words, target in entries)
    return f"```{{toctree}}\n{options}\n\n{lines}\n```\n\n"


def navigation(text: str) -> str:
    """The index with a toctree in each section, of the links in that section's lists."""
    before, *parts = SECTION.split(text)
    for title, body in zip(parts[::2], parts[1::2], strict=True):
        before += f"## {title}{body.rstrip()}\n\n"
        before += toctree(f":hidden:\n:caption: {title}", ENTRY.findall(body))
        if title == "Reference":
            before += toctree(":maxdepth: 1", reference.PAGES)
    return before


def read_source(app: Sphinx, name: str, source: list[str]) -> None:
    """Add the navigation to the index, and make plain text of links to folders."""
    here = Path(app.env.doc2path(name)).parent
    source[0] = LINK.sub(lambda m: m[1] if (here / m[2]).is_dir() else m[0], source[0])
    if name == root_doc:
        source[0] = navigation(source[0])


def finish(app: Sphinx, error: Exception | None) -> None:
    """Correct the HTML, and write the index.html that forwards to the index."""
    for page in Path(app.outdir).rglob("*.html"):
        text = page.read_text(encoding="utf-8")
        for old, new in MENDED.items():
            text = text.replace(old, new)
        text = SIGNATURE.sub(lambda m: re.sub(r"(?<=/)d[ld]|(?<=<)d[ld]", "div", m[0]), text)
        page.write_text(DASH.sub(r"\1 – ", text), encoding="utf-8")
    (Path(app.outdir) / "index.html").write_text(FORWARD, encoding="utf-8")


def setup(app: Sphinx) -> None:
    """Write the reference, which Sphinx then finds beside the other pages."""
    reference.write(ROOT / "docs/reference")
    app.connect("autodoc-process-signature", reference.sign)
    app.connect("autodoc-process-docstring", reference.read_docstring)
    app.connect("source-read", read_source)
    app.connect("build-finished", finish)
