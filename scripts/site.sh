#!/usr/bin/env bash
# Builds the website from the repository's pages with mdBook: target/site/index.html. Installs mdBook with cargo if it is missing.
# Every file that a page links to, pictures included, is copied. Fails if a page of the website links to a missing file.
# With --live, the program is built, and the gallery's pages that compute are added.
set -euo pipefail
cd "$(dirname "$0")/.."

mdbook="$(command -v mdbook || true)"
if [[ -z "$mdbook" ]]; then
    mdbook=target/tools/bin/mdbook
    [[ -x "$mdbook" ]] || cargo install mdbook --version 0.5.4 --locked --root target/tools
fi

book=target/site-source
rm -rf "$book" target/site
mkdir -p "$book/src"
cp site/book.toml site/wide.css "$book/"
[[ "${1:-}" != --live ]] || scripts/pages.sh "$book/src/live"
python3 - "$book/src" <<'PYTHON'
"""Copies the pages of the summary and the files that they link to, and makes a page of the notebook."""
import base64, json, re, shutil, sys
from pathlib import Path

book = Path(sys.argv[1])
LINK = re.compile(r"\]\(([^)#\s]+)(#[^)]*)?\)")


def copy(path: Path) -> None:
    (book / path).parent.mkdir(parents=True, exist_ok=True)
    shutil.copy(path, book / path)


def relative(path: Path) -> Path:
    return path.resolve().relative_to(Path.cwd())


def notebook(path: Path) -> str:
    """Returns a notebook as Markdown, with its text output and pictures."""
    parts = []
    for number, cell in enumerate(json.loads(path.read_text(encoding="utf-8"))["cells"]):
        source = "".join(cell["source"])
        parts.append(source if cell["cell_type"] == "markdown" else f"```python\n{source}\n```")
        for index, output in enumerate(cell.get("outputs", [])):
            data = output.get("data", {})
            if picture := data.get("image/png"):
                name = f"python-{number}-{index}.png"
                (book / "docs" / name).write_bytes(base64.b64decode("".join(picture)))
                parts.append(f"![Output of the cell above]({name})")
            elif text := output.get("text") or data.get("text/plain"):
                parts.append(f"```text\n{''.join(text)}\n```")
    return "\n\n".join(parts) + "\n"


summary = Path("site/SUMMARY.md").read_text(encoding="utf-8")
# Pages for developers follow at the end, under their own headings.
developers = [Path("CONTRIBUTING.md"), Path("docs/decisions/README.md"), *sorted(Path("docs/decisions").glob("[a-z]*.md"))]
for page in filter(Path.exists, developers):
    heading = page.read_text(encoding="utf-8").partition("\n")[0].lstrip("# ")
    summary += f"{'  ' if page.parent.name and page.name != 'README.md' else ''}- [{heading}]({page.as_posix()})\n"
pages = [Path(target) for target, _ in LINK.findall(summary)]
(book / "docs").mkdir()
# The list of pages that compute: those of scripts/pages.sh, and the reports of maps in results.
live = [(page, page.relative_to(book)) for page in sorted(book.glob("live/*.html")) if page.name != "index.html"]
reports = [(page, page) for page in sorted(Path("results").glob("**/report.html"))]
for page, _ in reports:
    copy(page)
lines = ["# Maps that compute", "", "Open a map, zoom in, move a slider, click a cell. Everything is computed in your browser.", ""]
for page, link in reports + live:
    title = re.search("<title>([^<]*)", page.read_text(encoding="utf-8"))
    lines.append(f"- [{title[1] if title else link.stem}]({link.as_posix()})")
(book / "live.md").write_text("\n".join(lines) + "\n", encoding="utf-8")
# A notebook becomes a page of its own.
(book / "docs/python.md").write_text(notebook(Path("docs/python.ipynb")), encoding="utf-8")
for page in pages:
    text = (book / page if (book / page).exists() else page).read_text(encoding="utf-8")
    # mdBook renames README.md to index.md, but not in links.
    text = text.replace("python.ipynb", "python.md").replace("README.md)", "index.md)").replace("README.md#", "index.md#")
    for target, _ in LINK.findall(text):
        linked = page.parent / target
        if "://" not in target and linked.suffix != ".md" and not (book / linked).exists() and linked.is_file():
            copy(relative(linked))
    (book / page).parent.mkdir(parents=True, exist_ok=True)
    (book / page).write_text(text, encoding="utf-8")
(book / "SUMMARY.md").write_text(summary, encoding="utf-8")
PYTHON

"$mdbook" build "$book"
python3 - target/site <<'PYTHON'
"""Fails if a page links to a file or a heading that the website lacks."""
import re, sys
from pathlib import Path
from urllib.parse import unquote

site, missing = Path(sys.argv[1]), []
pages = [page for page in site.rglob("*.html") if page.name not in ("404.html", "toc.html", "report.html") and page.parent.name != "live"]
ids = {page.resolve(): set(re.findall(r'id="([^"]+)"', page.read_text(encoding="utf-8"))) for page in pages}
for page in pages:
    for target in re.findall(r'(?:href|src)="([^"]+)', page.read_text(encoding="utf-8")):
        if re.match(r"[a-z]+:", target):
            continue
        path, _, fragment = unquote(target).partition("#")
        linked = (page.parent / path).resolve() if path else page.resolve()
        if not linked.exists() or (fragment and linked in ids and fragment not in ids[linked]):
            missing.append(f"{page.relative_to(site)}: {target}")
print("\n".join(missing) or "all links have targets")
sys.exit(bool(missing))
PYTHON
