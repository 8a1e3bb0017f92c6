"""Build the wheel and source distribution for a package index.

Usage: uv run python .ci/release.py https://github.com/OWNER/gaitchain [--out DIR]

An index shows the README and none of the files beside it. Links and pictures become
addresses in that repository, at the tag of this version, which the metadata name too.
"""

import argparse
import re
import shutil
import subprocess
import tempfile
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[1]
PARTS = ("pyproject.toml", "README.md", "LICENSE", "src")
LINK = re.compile(r"(!?)\[([^\]]*)\]\((?![a-z]+:|#)([^)]+)\)")


def main() -> None:
    """Build both from a copy, in which nothing but addresses is changed."""
    asked = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    asked.add_argument("repository", help="its address, without a slash at the end")
    asked.add_argument("--out", type=Path, default=ROOT / "dist")
    options = asked.parse_args()
    project = (ROOT / "pyproject.toml").read_text("utf-8")
    tag = "v" + tomllib.loads(project)["project"]["version"]
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder)
        for name in PARTS:
            part = ROOT / name
            copying = shutil.copytree if part.is_dir() else shutil.copyfile
            copying(part, copy / name)
        readme = (ROOT / "README.md").read_text("utf-8")
        text = absolute(readme, options.repository, tag)
        (copy / "README.md").write_text(text, "utf-8")
        urls = addresses(options.repository, tag)
        (copy / "pyproject.toml").write_text(project + urls, "utf-8")
        command = ["uv", "build", "--quiet", "--out-dir", options.out.resolve(), copy]
        subprocess.run(command, check=True)


def absolute(text: str, repository: str, tag: str) -> str:
    """Return the text with links and pictures of the repository as addresses."""

    def address(link: re.Match[str]) -> str:
        mark, words, path = link.groups()
        kind = "raw" if mark else "blob"
        return f"{mark}[{words}]({repository}/{kind}/{tag}/{path})"

    return LINK.sub(address, text)


def addresses(repository: str, tag: str) -> str:
    """Return the table of the project's addresses."""
    return f"""
[project.urls]
Homepage = "{repository}"
Documentation = "{repository}/blob/{tag}/docs/index.md"
Changelog = "{repository}/blob/{tag}/CHANGELOG.md"
Issues = "{repository}/issues"
"""


if __name__ == "__main__":
    main()
